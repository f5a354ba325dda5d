//! Independent pieces of work side by side: the landscapes of a stereo pair, the rows of an image.

use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// The pool and the process that made it.
static POOL: OnceLock<(u32, Option<ThreadPool>)> = OnceLock::new();

/// The pool, unless the machine grants no threads or this is a forked child, where its workers do not exist.
fn pool() -> Option<&'static ThreadPool> {
    let process = std::process::id();
    let (owner, pool) = POOL.get_or_init(|| (process, ThreadPoolBuilder::new().build().ok()));
    pool.as_ref().filter(|_| *owner == process)
}

/// Calls `work(index, item)` for every item, the first on the calling thread and the others on a pool.
///
/// Falls back to the calling thread where the machine grants no threads, and in a forked child, where the
/// parent's workers do not exist. Items must not depend on each other; results then do not depend on threads.
pub fn for_each<T: Send>(items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    match pool() {
        Some(pool) if items.len() > 1 => pool.in_place_scope(|scope| {
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

/// How many threads can work at once, the calling one included.
pub fn threads() -> usize {
    pool().map_or(1, ThreadPool::current_num_threads)
}

/// Calls `work(item)` for every item on at most so many threads; each takes the next item when it is done.
///
/// The calling thread is one of them, so that one thread is really one. Items must not depend on each other.
pub fn share<T: Send>(threads: usize, items: &mut [T], work: impl Fn(&mut T) + Sync) {
    let helpers = threads.min(self::threads()).min(items.len()).saturating_sub(1);
    match pool() {
        Some(pool) if helpers > 0 => {
            let queue = Mutex::new(items.iter_mut());
            let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
            let run = || {
                while let Some(item) = next() {
                    work(item);
                }
            };
            pool.in_place_scope(|scope| {
                for _ in 0..helpers {
                    scope.spawn(|_| run());
                }
                run();
            });
        }
        _ => items.iter_mut().for_each(work),
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

    #[test]
    fn shared_items_are_visited_once_on_any_number_of_threads() {
        for (size, threads) in [(0, 4), (1, 4), (2, 1), (33, 0), (33, 2), (100, usize::MAX)] {
            let mut items: Vec<usize> = (0..size).collect();
            super::share(threads, &mut items, |item| *item += 1);
            assert_eq!(items, (1..=size).collect::<Vec<_>>());
        }
    }
}
