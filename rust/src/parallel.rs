//! Independent pieces of work side by side, for the landscapes of a stereo pair.

use std::sync::OnceLock;

use rayon::{ThreadPool, ThreadPoolBuilder};

/// The pool and the process that made it.
static POOL: OnceLock<(u32, Option<ThreadPool>)> = OnceLock::new();

/// Calls `work(index, item)` for every item, the first on the calling thread and the others on a pool.
///
/// Falls back to the calling thread where the machine grants no threads, and in a forked child, where the
/// parent's workers do not exist. Items must not depend on each other; results then do not depend on threads.
pub fn for_each<T: Send>(items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    let process = std::process::id();
    let (owner, pool) = POOL.get_or_init(|| (process, ThreadPoolBuilder::new().build().ok()));
    match pool {
        Some(pool) if *owner == process && items.len() > 1 => pool.in_place_scope(|scope| {
            let mut items = items.iter_mut().enumerate();
            let first = items.next();
            let work = &work;
            for (index, item) in items {
                scope.spawn(move |_| work(index, item));
            }
            if let Some((index, item)) = first {
                work(index, item);
            }
        }),
        _ => items.iter_mut().enumerate().for_each(|(index, item)| work(index, item)),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_item_is_visited_once_with_its_own_index() {
        for size in [0, 1, 2, 33] {
            let mut items = vec![0; size];
            super::for_each(&mut items, |index, item| *item += index + 1);
            assert_eq!(items, (1..=size).collect::<Vec<_>>());
        }
    }
}
