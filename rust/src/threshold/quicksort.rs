//! Hoare's quicksort, the paper's way to the threshold.

use std::cmp::Ordering;

/// Slices up to this length are sorted by insertion.
const SHORT: usize = 24;

/// Hoare's quicksort, ascending, with the median of three as pivot.
///
/// Recurses into the shorter part only, so the stack stays logarithmic; an input made to defeat the pivot
/// is handed to the standard library's sort before it turns quadratic.
pub fn quicksort<T: Copy + PartialOrd>(values: &mut [T]) {
    let allowed = 4 * values.len().checked_ilog2().unwrap_or(0);
    sort(values, allowed);

    fn sort<T: Copy + PartialOrd>(mut values: &mut [T], mut allowed: u32) {
        while values.len() > SHORT {
            if allowed == 0 {
                values.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
                return;
            }
            allowed -= 1;
            let middle = partition(values);
            let (left, right) = values.split_at_mut(middle);
            let (short, long) = if left.len() < right.len() { (left, right) } else { (right, left) };
            sort(short, allowed);
            values = long;
        }
        insertion_sort(values);
    }
}

/// Splits so that nothing left of the returned index exceeds anything right of it; both sides are non-empty.
fn partition<T: Copy + PartialOrd>(values: &mut [T]) -> usize {
    let (mut i, mut j) = (0_usize, values.len() - 1);
    let middle = i.midpoint(j);
    if values[middle] < values[i] {
        values.swap(middle, i);
    }
    if values[j] < values[i] {
        values.swap(j, i);
    }
    if values[j] < values[middle] {
        values.swap(j, middle);
    }
    let pivot = values[middle];
    // Stopping on equal values splits a run of ties in the middle, where a landscape has many.
    loop {
        while values[i] < pivot {
            i += 1;
        }
        while pivot < values[j] {
            j -= 1;
        }
        if i >= j {
            return j + 1;
        }
        values.swap(i, j);
        i += 1;
        j -= 1;
    }
}

fn insertion_sort<T: Copy + PartialOrd>(values: &mut [T]) {
    for end in 1..values.len() {
        let value = values[end];
        let mut at = end;
        while at > 0 && value < values[at - 1] {
            values[at] = values[at - 1];
            at -= 1;
        }
        values[at] = value;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn quicksort_sorts(mut values in prop::collection::vec(0_u32..50, 0..400)) {
            let mut sorted = values.clone();
            sorted.sort_unstable();
            quicksort(&mut values);
            prop_assert_eq!(values, sorted);
        }
    }

    #[test]
    fn quicksort_survives_orders_made_to_defeat_it() {
        let n = 200_000_u32;
        let mut cases = [(0..n).collect::<Vec<_>>(), (0..n).rev().collect(), vec![7; n as usize]];
        for values in &mut cases {
            quicksort(values);
            assert!(values.is_sorted());
        }
    }
}
