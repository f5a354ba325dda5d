//! Eye, arm and hand as coupled dynamical systems, and their movements imagined (Section III-C1).
//!
//! A state is ten numbers relative to the goal: the fixation point (3), the palm's place (3), its rotation vector
//! (3) and the hand's opening. Whether a system converges at some step is for the caller to know: this is said by
//! its certificate, which is checked where models are made.

mod mixture;
mod movement;

use crate::error::{Error, Result};
pub use mixture::Gaussians;
use mixture::{Matrices, Mixture, Regression};
pub use movement::{End, Tolerance, Watch};

/// Fixation point, place, rotation vector, opening.
pub type State = [f64; 10];

/// The largest number that may stand in a state: its square is far from overflow.
pub const LARGEST: f64 = 1e100;

/// A mixture of linear systems of dimension d as it is given.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    /// The mixture over the first m <= d coordinates.
    pub mixture: Gaussians,
    /// K x d x d, row-major [1/s].
    pub matrices: Vec<f64>,
}

/// A regression of one part's distance on another's as it is given.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// The mixture over (given, expected).
    pub mixture: Gaussians,
    /// Below this distance the expectation is drawn to 0.
    pub near: f64,
}

/// How fast each system is and how soon it reacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Factors of the velocity of eye, arm and hand.
    pub alpha: [f64; 3],
    /// Factors of the state that each sees.
    pub beta: [f64; 3],
    /// The arm's wait is measured against no smaller distance [m].
    pub close: f64,
}

/// Three systems and two couplings, ready to be rolled out.
#[derive(Clone, Debug, PartialEq)]
pub struct CoupledSystem {
    eye: (Mixture, Matrices<3>),
    /// Place and rotation share the weights and nothing else.
    arm: (Mixture, Matrices<3>, Matrices<3>),
    hand: (Mixture, Matrices<1>),
    eye_arm: Regression,
    arm_hand: Regression,
    rates: Rates,
    components: usize,
}

impl CoupledSystem {
    /// Checks every array and prepares the mixtures.
    ///
    /// # Errors
    /// The first argument that does not fit, by its name and index; an arm that mixes place and rotation.
    pub fn new(
        [eye, arm, hand]: [&System; 3],
        [eye_arm, arm_hand]: [&Coupling; 2],
        rates: Rates,
    ) -> Result<Self> {
        let eye_mixture = mixture_of("eye", eye, 3)?;
        let arm_mixture = mixture_of("arm", arm, 6)?;
        let hand_mixture = mixture_of("hand", hand, 1)?;
        for (at, &a) in arm.matrices.iter().enumerate() {
            let (k, i, j) = (at / 36, at / 6 % 6, at % 6);
            if (i < 3) != (j < 3) && a != 0.0 {
                let expected = "zero between place and rotation";
                return Err(Error::element("arm.matrices", &[k, i, j], expected, a));
            }
        }
        for (name, values) in [("alpha", &rates.alpha[..]), ("beta", &rates.beta), ("close", &[rates.close])]
        {
            if let Some(at) = values.iter().position(|&x| !(x > 0.0 && x.is_finite())) {
                return Err(Error::element(name, &[at], "positive and finite", values[at]));
            }
        }
        let eye_arm = Regression::new("eye_arm", &eye_arm.mixture, eye_arm.near)?;
        let arm_hand = Regression::new("arm_hand", &arm_hand.mixture, arm_hand.near)?;
        let systems = [&eye_mixture, &arm_mixture, &hand_mixture].map(Mixture::len);
        let components = systems.into_iter().fold(eye_arm.len().max(arm_hand.len()), usize::max);
        Ok(Self {
            eye: (eye_mixture, Matrices::block(&eye.matrices, 3, 0)),
            arm: (arm_mixture, Matrices::block(&arm.matrices, 6, 0), Matrices::block(&arm.matrices, 6, 3)),
            hand: (hand_mixture, Matrices::block(&hand.matrices, 1, 0)),
            eye_arm,
            arm_hand,
            rates,
            components,
        })
    }

    /// Components of eye, arm and hand.
    pub fn components(&self) -> [usize; 3] {
        [self.eye.0.len(), self.arm.0.len(), self.hand.0.len()]
    }

    /// Room for the weights of any of the mixtures.
    fn space(&self) -> Vec<f64> {
        vec![0.0; self.components]
    }

    /// The state one Euler step of `dt` [s] later.
    #[inline]
    fn advanced(&self, state: &State, amplitude: f64, dt: f64, space: &mut [f64]) -> State {
        let Rates { alpha, beta, close } = self.rates;
        let &[ex, ey, ez, px, py, pz, rx, ry, rz, opening] = state;
        let (eye, place, turn) = ([ex, ey, ez], [px, py, pz], [rx, ry, rz]);
        let distance = length(place);
        let rho = self.eye_arm.expected(length(eye), space).max(0.0);
        let gate = 1.0 - (rho / distance.max(close)).min(1.0);
        let wanted = amplitude * self.arm_hand.expected(distance, space).clamp(0.0, 1.0);

        let weights = self.eye.0.posterior(beta[0], &eye, space);
        let eye = moved(eye, dt * alpha[0] * beta[0], self.eye.1.mixed(weights, eye));

        let seen = beta[1] * gate;
        let weights = self.arm.0.posterior(seen, &state[3..9], space);
        let place = moved(place, dt * alpha[1] * seen, self.arm.1.mixed(weights, place));
        let turn = short_way(moved(turn, dt * alpha[1] * seen, self.arm.2.mixed(weights, turn)));

        let off = [opening - wanted];
        let weights = self.hand.0.posterior(beta[2], &off, space);
        let [opening] = moved([opening], dt * alpha[2] * beta[2], self.hand.1.mixed(weights, off));

        let ([ex, ey, ez], [px, py, pz], [rx, ry, rz]) = (eye, place, turn);
        [ex, ey, ez, px, py, pz, rx, ry, rz, opening]
    }
}

#[inline(always)]
fn moved<const D: usize>(x: [f64; D], factor: f64, velocity: [f64; D]) -> [f64; D] {
    std::array::from_fn(|i| x[i] + factor * velocity[i])
}

#[inline(always)]
fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// The same rotation by at most half a turn, for a vector of less than two turns.
#[inline(always)]
fn short_way(turn: [f64; 3]) -> [f64; 3] {
    let angle = length(turn);
    if angle > std::f64::consts::PI {
        let factor = 1.0 - 2.0 * std::f64::consts::PI / angle;
        return turn.map(|x| x * factor);
    }
    turn
}

/// The mixture of a system of `d` dimensions.
fn mixture_of(name: &'static str, system: &System, d: usize) -> Result<Mixture> {
    let mixture = Mixture::new(name, &system.mixture)?;
    if mixture.coordinates() > d {
        let expected = format!("over at most {d} coordinates");
        return Err(Error::shape(format!("{name}.means"), expected, mixture.coordinates().to_string()));
    }
    checked(name, "matrices", &system.matrices, mixture.len() * d * d)?;
    Ok(mixture)
}

/// Checks that there are that many numbers, all finite.
fn checked(name: &str, part: &str, values: &[f64], count: usize) -> Result<()> {
    if values.len() != count {
        let expected = format!("of {count} elements");
        return Err(Error::shape(format!("{name}.{part}"), expected, values.len().to_string()));
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(at) => Err(Error::element(format!("{name}.{part}"), &[at], "finite", values[at])),
        None => Ok(()),
    }
}

/// Checks how many coordinates a mixture is over.
fn dimension(name: &str, part: &str, expected: usize, found: usize) -> Result<()> {
    if expected == found {
        return Ok(());
    }
    let expected = format!("over {expected} coordinates");
    Err(Error::shape(format!("{name}.{part}"), expected, found.to_string()))
}

#[cfg(test)]
mod tests;
