//! Movements from their start until they have arrived: one with its path, or many with their ends.

use super::{CoupledSystem, LARGEST, State, length};
use crate::error::{Error, Result};
use crate::parallel;

/// How close to the goal counts as there. With 0 a movement never ends before its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Of the fixation point [m].
    pub fixation: f64,
    /// Of the palm [m].
    pub place: f64,
    /// Of the palm [rad].
    pub turn: f64,
    /// Of the hand.
    pub opening: f64,
}

/// A hand that is open less than `opening` while the palm is farther than `distance` [m] has closed early.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch {
    /// Distance from the goal's opening.
    pub opening: f64,
    /// Distance of the palm from its goal.
    pub distance: f64,
}

/// How one of many movements ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// The state in the end.
    pub state: State,
    /// Steps after which everything was within its tolerance, or nothing where it never was.
    pub arrived: Option<usize>,
    /// Whether the hand was ever seen to have closed early.
    pub closed_early: bool,
}

/// One movement to compute.
struct Task<'a> {
    start: &'a State,
    steps: usize,
    end: &'a mut End,
}

/// Movements that one thread computes in a row.
const CHUNK: usize = 32;

impl CoupledSystem {
    /// Steps that a movement may take.
    pub const MAX_STEPS: usize = 1_000_000;

    /// Appends the states from `start` to the first that is within `tolerance`, or to the one after `steps` steps;
    /// returns whether it arrived. `path` is cleared first.
    ///
    /// # Errors
    /// A number that is not finite or outside its range; a system that grows beyond all numbers.
    pub fn roll_out(
        &self,
        start: &State,
        amplitude: f64,
        dt: f64,
        steps: usize,
        tolerance: &Tolerance,
        path: &mut Vec<State>,
    ) -> Result<bool> {
        if let Some(i) = wrong(start) {
            return Err(Error::element("state", &[i], EXPECTED, start[i]));
        }
        check(amplitude, dt, tolerance)?;
        if steps > Self::MAX_STEPS {
            return Err(Error::scalar("steps", MOST_STEPS, steps));
        }
        let mut space = self.space();
        let mut state = *start;
        let mut arrived = tolerance.holds(&state);
        path.clear();
        path.push(state);
        while !arrived && path.len() <= steps {
            state = self.advanced(&state, amplitude, dt, &mut space);
            path.push(state);
            arrived = tolerance.holds(&state);
        }
        if state.iter().all(|x| x.is_finite()) { Ok(arrived) } else { Err(unbounded()) }
    }

    /// How movements from many starts end, each after at most its own number of steps.
    ///
    /// They do not depend on each other, so the ends are the same on any number of threads.
    ///
    /// # Errors
    /// As for one; nothing is returned then.
    pub fn ends(
        &self,
        starts: &[State],
        amplitude: f64,
        dt: f64,
        steps: &[usize],
        tolerance: &Tolerance,
        watch: &Watch,
    ) -> Result<Vec<End>> {
        for (n, start) in starts.iter().enumerate() {
            if let Some(i) = wrong(start) {
                return Err(Error::element("states", &[n, i], EXPECTED, start[i]));
            }
        }
        check(amplitude, dt, tolerance)?;
        if steps.len() != starts.len() {
            let expected = format!("one number for each of {} starts", starts.len());
            return Err(Error::shape("steps", expected, steps.len().to_string()));
        }
        if let Some(n) = steps.iter().position(|&steps| steps > Self::MAX_STEPS) {
            return Err(Error::element("steps", &[n], MOST_STEPS, steps[n]));
        }
        check_not_negative("watch", &[watch.opening, watch.distance])?;
        let blank = End { state: [0.0; 10], arrived: None, closed_early: false };
        let mut ends = vec![blank; starts.len()];
        let tasks = starts.iter().zip(steps).zip(&mut ends);
        let mut tasks: Vec<Task> = tasks.map(|((start, &steps), end)| Task { start, steps, end }).collect();
        let mut chunks: Vec<&mut [Task]> = tasks.chunks_mut(CHUNK).collect();
        parallel::for_each(&mut chunks, |_, chunk| {
            let mut space = self.space();
            for Task { start, steps, end } in chunk.iter_mut() {
                **end = self.end(start, amplitude, dt, *steps, tolerance, watch, &mut space);
            }
        });
        let finite = ends.iter().all(|end| end.state.iter().all(|x| x.is_finite()));
        if finite { Ok(ends) } else { Err(unbounded()) }
    }

    #[expect(clippy::too_many_arguments, reason = "the same as above, and what a thread keeps")]
    fn end(
        &self,
        start: &State,
        amplitude: f64,
        dt: f64,
        steps: usize,
        tolerance: &Tolerance,
        watch: &Watch,
        space: &mut [f64],
    ) -> End {
        let mut state = *start;
        let mut closed_early = false;
        for step in 0..=steps {
            closed_early |= watch.closed(&state);
            if tolerance.holds(&state) {
                return End { state, arrived: Some(step), closed_early };
            }
            if step < steps {
                state = self.advanced(&state, amplitude, dt, space);
            }
        }
        End { state, arrived: None, closed_early }
    }
}

impl Tolerance {
    #[inline(always)]
    fn holds(&self, &[ex, ey, ez, px, py, pz, rx, ry, rz, opening]: &State) -> bool {
        length([px, py, pz]) < self.place
            && opening.abs() < self.opening
            && length([rx, ry, rz]) < self.turn
            && length([ex, ey, ez]) < self.fixation
    }
}

impl Watch {
    #[inline(always)]
    fn closed(&self, state: &State) -> bool {
        state[9] < self.opening && length([state[3], state[4], state[5]]) > self.distance
    }
}

const EXPECTED: &str = "finite and at most 1e100";
const MOST_STEPS: &str = "at most 1000000";

/// The first number that cannot stand in a state. Written so that NaN cannot.
fn wrong(state: &State) -> Option<usize> {
    state.iter().position(|x| !(-LARGEST..=LARGEST).contains(x))
}

fn check(amplitude: f64, dt: f64, tolerance: &Tolerance) -> Result<()> {
    if !(dt > 0.0 && dt.is_finite()) {
        return Err(Error::scalar("dt", "positive and finite", dt));
    }
    if !(0.0..=LARGEST).contains(&amplitude) {
        return Err(Error::scalar("amplitude", "from 0 to 1e100", amplitude));
    }
    let Tolerance { fixation, place, turn, opening } = *tolerance;
    check_not_negative("tolerance", &[fixation, place, turn, opening])
}

fn check_not_negative(name: &'static str, values: &[f64]) -> Result<()> {
    match values.iter().position(|x| !(0.0..).contains(x)) {
        Some(at) => Err(Error::element(name, &[at], "a number >= 0", values[at])),
        None => Ok(()),
    }
}

fn unbounded() -> Error {
    Error::conflict("dt", "makes a system grow beyond all numbers: it is not certified for so large a step")
}
