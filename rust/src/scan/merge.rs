//! Windows that hit, as one thing for all that are near each other, be it by way of others.

use std::ops::Range;

/// A box `[u0, v0, u1, v1]`, half-open.
pub type Hull = [i32; 4];

/// Hits in one row of windows that follow each other without a gap: from the first to the last of them.
#[derive(Clone, Copy, Debug)]
struct Run {
    v: i32,
    first: i32,
    last: i32,
}

/// Boxes around the groups of windows of `size` pixels whose upper left pixels are given, in no special order.
/// Of one group are those that overlap, touch, or are `gap` pixels apart at most.
pub fn merge_corners(corners: &[[i32; 2]], size: i32, gap: i32) -> Vec<Hull> {
    let mut runs: Vec<Run> = corners.iter().map(|&[u, v]| Run { v, first: u, last: u }).collect();
    runs.sort_unstable_by_key(|run| (run.v, run.first));
    merge(&runs, size, gap)
}

/// The same for scores of all windows of an image, of which those hit that reach `hit`.
pub fn merge_scores(scores: &[f32], columns: usize, hit: f32, size: i32, gap: i32) -> Vec<Hull> {
    let mut runs = Vec::new();
    for (v, row) in scores.chunks_exact(columns.max(1)).enumerate() {
        // Most rows have none, which is seen without a look at each of its windows.
        if !row.iter().fold(false, |any, &score| any | (score >= hit)) {
            continue;
        }
        let mut run: Option<Run> = None;
        for (u, &score) in row.iter().enumerate() {
            if score >= hit {
                let (u, v) = (u as i32, v as i32);
                match &mut run {
                    // Windows of one row that are near are one run, whatever is between them.
                    Some(run) if u - run.last <= size + gap => run.last = u,
                    other => runs.extend(other.replace(Run { v, first: u, last: u })),
                }
            }
        }
        runs.extend(run);
    }
    merge(&runs, size, gap)
}

/// Joins runs that are near. They are in the order of their rows.
fn merge(runs: &[Run], size: i32, gap: i32) -> Vec<Hull> {
    let near = size + gap;
    let mut parents: Vec<usize> = (0..runs.len()).collect();
    let mut reach: Range<usize> = 0..0;
    for (k, run) in runs.iter().enumerate() {
        // Those of the rows that a window of this row comes near.
        while runs[reach.start].v < run.v - near {
            reach.start += 1;
        }
        reach.end = k;
        for other in reach.clone() {
            if runs[other].first <= run.last + near && run.first <= runs[other].last + near {
                let (a, b) = (root(&mut parents, other), root(&mut parents, k));
                parents[a.max(b)] = a.min(b);
            }
        }
    }
    let mut hulls: Vec<Hull> = Vec::new();
    let mut of = vec![usize::MAX; runs.len()];
    for (k, run) in runs.iter().enumerate() {
        let group = root(&mut parents, k);
        let hull = [run.first, run.v, run.last + size, run.v + size];
        if of[group] == usize::MAX {
            of[group] = hulls.len();
            hulls.push(hull);
        } else {
            let all = &mut hulls[of[group]];
            *all = [all[0].min(hull[0]), all[1].min(hull[1]), all[2].max(hull[2]), all[3].max(hull[3])];
        }
    }
    hulls
}

/// The first run of the group, to which the way becomes shorter.
fn root(parents: &mut [usize], mut k: usize) -> usize {
    while parents[k] != k {
        parents[k] = parents[parents[k]];
        k = parents[k];
    }
    k
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By comparing each with each, until nothing changes.
    fn by_pairs(corners: &[[i32; 2]], size: i32, gap: i32) -> Vec<Hull> {
        let mut group: Vec<usize> = (0..corners.len()).collect();
        let mut changed = true;
        while changed {
            changed = false;
            for (i, a) in corners.iter().enumerate() {
                for (j, b) in corners.iter().enumerate() {
                    let near = (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) <= size + gap;
                    if near && group[i] != group[j] {
                        let low = group[i].min(group[j]);
                        (group[i], group[j], changed) = (low, low, true);
                    }
                }
            }
        }
        let hull = |wanted: usize| {
            let members = corners.iter().zip(&group).filter(|&(_, &g)| g == wanted).map(|(c, _)| c);
            members.fold([i32::MAX, i32::MAX, i32::MIN, i32::MIN], |hull, &[u, v]| {
                [hull[0].min(u), hull[1].min(v), hull[2].max(u + size), hull[3].max(v + size)]
            })
        };
        (0..corners.len()).filter(|g| group.contains(g)).map(hull).collect()
    }

    fn sorted(mut hulls: Vec<Hull>) -> Vec<Hull> {
        hulls.sort_unstable();
        hulls
    }

    proptest! {
        #[test]
        fn windows_are_one_when_a_chain_of_near_ones_connects_them(
            corners in prop::collection::vec(prop::array::uniform2(0..40_i32), 0..40),
            (size, gap) in (1..9_i32, 0..5_i32),
        ) {
            let expected = sorted(by_pairs(&corners, size, gap));
            prop_assert_eq!(sorted(merge_corners(&corners, size, gap)), expected.clone());
            let mut scores = vec![0.2_f32; 40 * 40];
            for &[u, v] in &corners {
                scores[(v * 40 + u) as usize] = 0.3;
            }
            prop_assert_eq!(sorted(merge_scores(&scores, 40, 0.3, size, gap)), expected);
        }
    }

    #[test]
    fn windows_that_touch_at_a_corner_are_one_and_a_pixel_farther_they_are_two() {
        assert_eq!(merge_corners(&[[5, 5], [9, 9]], 4, 0), [[5, 5, 13, 13]]);
        assert_eq!(sorted(merge_corners(&[[5, 5], [10, 9]], 4, 0)), [[5, 5, 9, 9], [10, 9, 14, 13]]);
        assert!(merge_corners(&[], 4, 0).is_empty());
        assert!(merge_scores(&[], 0, 0.5, 4, 0).is_empty());
        assert!(merge_scores(&[f32::NAN; 6], 3, 0.5, 4, 0).is_empty());
    }
}
