use super::*;

const NEVER: Tolerance = Tolerance { fixation: 0.0, place: 0.0, turn: 0.0, opening: 0.0 };
const NEAR: Tolerance = Tolerance { fixation: 0.001, place: 0.001, turn: 0.017, opening: 0.01 };
const WATCH: Watch = Watch { opening: 0.1, distance: 0.02 };

/// x' = -rates x.
fn linear(rates: &[f64]) -> System {
    let d = rates.len();
    let diagonal = |value: &dyn Fn(usize) -> f64| {
        (0..d * d).map(|at| if at / d == at % d { value(at / d) } else { 0.0 }).collect()
    };
    let mixture = Gaussians { weights: vec![1.0], means: vec![0.0; d], covariances: diagonal(&|_| 1.0) };
    System { mixture, matrices: diagonal(&|i| -rates[i]) }
}

/// Expects `slope psi + start`.
fn line(slope: f64, start: f64) -> Coupling {
    let covariances = vec![0.01, 0.01 * slope, 0.01 * slope, 0.01 * slope * slope + 1e-4];
    let mixture = Gaussians { weights: vec![1.0], means: vec![0.2, 0.2 * slope + start], covariances };
    Coupling { mixture, near: 0.02 }
}

fn rates() -> Rates {
    Rates { alpha: [1.0; 3], beta: [1.0; 3], close: 0.001 }
}

/// Eye 6/s, place 2/s, turn 3/s, hand 5/s; the arm is expected at 0.8 |e|, the hand at 0.9.
fn simple(rates: Rates) -> CoupledSystem {
    let systems = [linear(&[6.0; 3]), linear(&[2.0, 2.0, 2.0, 3.0, 3.0, 3.0]), linear(&[5.0])];
    CoupledSystem::new(systems.each_ref(), [&line(0.8, 0.0), &line(0.0, 0.9)], rates).unwrap()
}

fn step(system: &CoupledSystem, state: State, amplitude: f64) -> State {
    let mut path = Vec::new();
    system.roll_out(&state, amplitude, 0.01, 1, &NEVER, &mut path).unwrap();
    assert_eq!(path.len(), 2);
    path[1]
}

fn assert_close(found: &[f64], expected: &[f64]) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{found:?} {expected:?}");
    }
}

#[test]
fn every_system_moves_by_its_own_rate_and_the_hand_towards_what_is_asked_for() {
    let state = [0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.3, 0.0, 0.5];
    let found = step(&simple(rates()), state, 0.5);
    let hand = 0.5 - 0.05 * (0.5 - 0.45);
    assert_close(&found, &[0.0, 0.0, 0.0, 0.2 * 0.98, 0.0, 0.0, 0.0, 0.3 * 0.97, 0.0, hand]);
    let found = step(&simple(rates()), [0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5], 0.0);
    assert_close(&found, &[0.0, 0.094, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.475]);
}

#[test]
fn the_arm_waits_for_the_eye() {
    // Expected at 0.16, stands at 0.2: g = 0.2.
    let found = step(&simple(rates()), [0.2, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.5, 0.9], 1.0);
    assert_close(&found[3..9], &[0.0, 0.2 * (1.0 - 0.02 * 0.2), 0.0, 0.0, 0.0, 0.5 * (1.0 - 0.03 * 0.2)]);
    // Stands closer than it is expected to.
    let still = [0.2, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.5, 0.9];
    assert_close(&step(&simple(rates()), still, 1.0)[3..9], &still[3..9]);
    // Exactly at its place, with the eye far.
    let turned = [0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.9];
    assert_close(&step(&simple(rates()), turned, 1.0)[3..9], &turned[3..9]);
    // And with the eye so near that the arm is expected within the distance that counts as there.
    let near = [0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.9];
    let gate = 1.0 - 0.8 * 0.002 * 0.1 / 0.001;
    assert_close(&step(&simple(rates()), near, 1.0)[8..9], &[0.5 * (1.0 - 0.03 * gate)]);
}

#[test]
fn alpha_and_beta_scale_linear_systems_by_their_product() {
    let scaled = simple(Rates { alpha: [0.5, 0.25, 2.0], beta: [3.0, 2.0, 0.5], close: 0.001 });
    let found = step(&scaled, [0.1, 0.0, 0.0, 0.2, 0.0, 0.0, 0.3, 0.0, 0.0, 0.4], 1.0);
    let gate = 1.0 - 0.08 / 0.2;
    assert_close(&found[..1], &[0.1 * (1.0 - 0.06 * 1.5)]);
    assert_close(&found[3..4], &[0.2 * (1.0 - 0.02 * 0.5 * gate)]);
    assert_close(&found[6..7], &[0.3 * (1.0 - 0.03 * 0.5 * gate)]);
    assert_close(&found[9..], &[0.4 - 0.05 * (0.4 - 0.9)]);
}

#[test]
fn mixed_systems_weigh_their_matrices_by_where_beta_x_is() {
    let mixture = Gaussians { weights: vec![0.4, 0.6], means: vec![0.0, 1.0], covariances: vec![0.25, 0.49] };
    let hand = System { mixture, matrices: vec![-1.0, -4.0] };
    let system = |beta| {
        let rates = Rates { beta: [1.0, 1.0, beta], ..rates() };
        let parts = [&linear(&[6.0; 3]), &linear(&[2.0; 6]), &hand];
        CoupledSystem::new(parts, [&line(0.8, 0.0), &line(0.0, 0.9)], rates).unwrap()
    };
    for (x, beta) in [(0.3_f64, 1.0), (0.8, 1.0), (0.4, 2.0), (-0.5, 1.0)] {
        let seen = beta * x;
        let first = 0.4 / 0.5 * (-0.5 * (seen / 0.5).powi(2)).exp();
        let second = 0.6 / 0.7 * (-0.5 * ((seen - 1.0) / 0.7).powi(2)).exp();
        let slope = -(first + 4.0 * second) / (first + second);
        let found = step(&system(beta), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, x], 1.0);
        assert_close(&found[9..], &[x + 0.01 * slope * seen]);
    }
}

/// Two components along the first axis, where matrices differ, and a turn that is not symmetric.
fn mixed(d: usize) -> System {
    let diagonal =
        |value: f64| -> Vec<f64> { (0..9).map(|at| if at % 4 == 0 { value } else { 0.0 }).collect() };
    let mixture = Gaussians {
        weights: vec![0.4, 0.6],
        means: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        covariances: [diagonal(0.25), diagonal(0.49)].concat(),
    };
    let mut matrices = vec![0.0; 2 * d * d];
    for k in 0..2 {
        for i in 0..d {
            matrices[(k * d + i) * d + i] = -1.0 - 3.0 * k as f64;
        }
        for first in (0..d).step_by(3) {
            matrices[(k * d + first) * d + first + 1] = 2.0;
        }
    }
    System { mixture, matrices }
}

#[test]
fn eye_and_arm_look_their_weights_up_where_they_see_themselves() {
    let (eye, arm) = (mixed(3), mixed(6));
    let rates = Rates { beta: [2.0, 0.5, 1.0], ..rates() };
    let system = |eye: &System, arm: &System| {
        CoupledSystem::new([eye, arm, &linear(&[5.0])], [&line(0.8, 0.0), &line(0.0, 0.9)], rates).unwrap()
    };
    let decay = |x: f64, y: f64| {
        let first = 0.4 / 0.5_f64.powi(3) * (-0.5 * (x * x + y * y) / 0.25).exp();
        let second = 0.6 / 0.7_f64.powi(3) * (-0.5 * ((x - 1.0) * (x - 1.0) + y * y) / 0.49).exp();
        (first + 4.0 * second) / (first + second)
    };
    let state = [0.2, 0.1, 0.0, 0.5, 0.4, 0.0, 0.3, -0.2, 0.1, 0.9];
    let found = step(&system(&eye, &arm), state, 1.0);
    let (slope, dt) = (decay(0.4, 0.2), 0.02);
    assert_close(&found[..2], &[0.2 + dt * (2.0 * 0.1 - slope * 0.2), 0.1 - dt * slope * 0.1]);
    let rho = 0.8 * 0.05_f64.sqrt();
    let seen = 0.5 * (1.0 - rho / 0.41_f64.sqrt());
    let (slope, dt) = (decay(seen * 0.5, seen * 0.4), 0.01 * seen);
    assert_close(&found[3..5], &[0.5 + dt * (2.0 * 0.4 - slope * 0.5), 0.4 - dt * slope * 0.4]);
    assert_close(&found[6..8], &[0.3 + dt * (-2.0 * 0.2 - slope * 0.3), -0.2 + dt * slope * 0.2]);
    assert_close(&found[8..9], &[0.1 - dt * slope * 0.1]);
}

#[test]
fn expectations_stay_within_what_makes_sense() {
    let system = |eye_arm: f64, arm_hand: f64| {
        let systems = [linear(&[6.0; 3]), linear(&[2.0; 6]), linear(&[5.0])];
        CoupledSystem::new(systems.each_ref(), [&line(eye_arm, 0.0), &line(0.0, arm_hand)], rates()).unwrap()
    };
    let state = [0.4, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5];
    // Expected nearer than the goal: the arm is free. Expected beyond fully open, or behind closed.
    assert_close(&step(&system(-1.0, 3.0), state, 1.0)[3..4], &[0.2 * 0.98]);
    assert_close(&step(&system(-1.0, 3.0), state, 1.0)[9..], &[0.5 + 0.05 * 0.5]);
    assert_close(&step(&system(-1.0, -3.0), state, 1.0)[9..], &[0.5 * 0.95]);
}

#[test]
fn a_turn_past_half_a_turn_goes_the_short_way() {
    let past = [0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 4.0, 0.0, 0.5];
    let found = step(&simple(rates()), past, 1.0);
    assert_close(&found[6..9], &[0.0, 4.0 * 0.97 - 2.0 * std::f64::consts::PI, 0.0]);
    let angle = 2.0 * std::f64::consts::PI - 0.5;
    let found = short_way([0.0, angle * 0.6, angle * 0.8]);
    assert_close(&found, &[0.0, -0.3, -0.4]);
    assert_eq!(short_way([0.0, 3.0, 0.0]), [0.0, 3.0, 0.0]);
}

#[test]
fn a_movement_ends_where_everything_is_within_its_tolerance() {
    let system = simple(rates());
    let mut path = vec![[7.0; 10]];
    let state = [0.3, 0.1, 0.0, 0.2, -0.1, 0.1, 0.0, 0.3, 0.0, 0.5];
    assert!(system.roll_out(&state, 1.0, 0.01, 3000, &NEAR, &mut path).unwrap());
    assert_eq!(path[0], state);
    let last = path[path.len() - 1];
    assert!(length([last[3], last[4], last[5]]) < 0.001 && last[9].abs() < 0.01);
    assert!(!system.roll_out(&state, 1.0, 0.01, 20, &NEAR, &mut path).unwrap());
    assert_eq!(path.len(), 21);
    assert!(system.roll_out(&[0.0; 10], 1.0, 0.01, 20, &NEAR, &mut path).unwrap());
    assert_eq!(path.len(), 1);
    for i in [0, 3, 6, 9] {
        let mut off = [0.0; 10];
        off[i] = -0.018;
        assert!(!system.roll_out(&off, 1.0, 0.01, 0, &NEAR, &mut path).unwrap());
    }
}

#[test]
fn a_movement_has_the_same_bits_on_every_machine() {
    let systems = [mixed(3), mixed(6), linear(&[5.0])];
    let couplings = [line(0.8, 0.0), line(0.1, 0.8)];
    let system = CoupledSystem::new(systems.each_ref(), couplings.each_ref(), rates()).unwrap();
    let start = [0.3, -0.2, 0.1, 0.4, 0.3, -0.2, 2.0, -1.0, 0.5, 0.3];
    let mut path = Vec::new();
    system.roll_out(&start, 1.0, 0.01, 200, &NEVER, &mut path).unwrap();
    let bits = path.iter().flatten().fold(0_u64, |hash, x| hash.rotate_left(5) ^ x.to_bits());
    assert_eq!(format!("{bits:016x}"), "d0d24890ad6b3c04");
}

#[test]
fn many_movements_end_as_each_of_them_alone() {
    let system = simple(rates());
    let starts: Vec<State> = (0..200)
        .map(|n| std::array::from_fn(|i| (f64::from(n) * 1.3 + i as f64 * 2.1).sin() * 0.5))
        .collect();
    let steps: Vec<usize> = (0..200).map(|n| 5 * n).collect();
    let ends = system.ends(&starts, 0.9, 0.01, &steps, &NEAR, &WATCH).unwrap();
    let mut path = Vec::new();
    for ((start, &steps), end) in starts.iter().zip(&steps).zip(&ends) {
        let arrived = system.roll_out(start, 0.9, 0.01, steps, &NEAR, &mut path).unwrap();
        assert_eq!(end.state, path[path.len() - 1]);
        assert_eq!(end.arrived, arrived.then(|| path.len() - 1));
        let early = path.iter().any(|s| s[9] < 0.1 && length([s[3], s[4], s[5]]) > 0.02);
        assert_eq!(end.closed_early, early);
    }
    assert!(ends.iter().any(|end| end.arrived.is_some()) && ends.iter().any(|end| end.arrived.is_none()));
    assert!(ends.iter().any(|end| end.closed_early) && ends.iter().any(|end| !end.closed_early));
    assert_eq!(system.ends(&[], 1.0, 0.01, &[], &NEAR, &WATCH).unwrap(), []);
}

#[test]
fn very_far_states_stay_finite() {
    let system = simple(rates());
    let mut path = Vec::new();
    for far in [1e3, 1e6, 1e100] {
        let start = [far, -far, far, -far, far, far, 3.0, 0.0, 0.0, far];
        system.roll_out(&start, 1.0, 0.01, 500, &NEAR, &mut path).unwrap();
        assert!(path.iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn what_is_wrong_is_named() {
    let system = simple(rates());
    let mut path = Vec::new();
    let mut message = |state: State, amplitude, dt, steps, tolerance: &Tolerance| {
        system.roll_out(&state, amplitude, dt, steps, tolerance, &mut path).unwrap_err().to_string()
    };
    let (good, mut bad) = ([0.1; 10], [0.1; 10]);
    bad[4] = f64::NAN;
    let expected = "state must be finite and at most 1e100, got NaN at state[4]";
    assert_eq!(message(bad, 1.0, 0.01, 5, &NEAR), expected);
    assert!(message([1e101; 10], 1.0, 0.01, 5, &NEAR).starts_with("state must be"));
    assert!(message(good, f64::NAN, 0.01, 5, &NEAR).starts_with("amplitude must be"));
    assert!(message(good, -1.0, 0.01, 5, &NEAR).starts_with("amplitude must be"));
    assert!(message(good, 1.0, 0.0, 5, &NEAR).starts_with("dt must be positive"));
    assert!(message(good, 1.0, f64::INFINITY, 5, &NEAR).starts_with("dt must be positive"));
    assert!(message(good, 1.0, 0.01, 1_000_001, &NEAR).starts_with("steps must be at most 1000000"));
    let negative = Tolerance { turn: -1.0, ..NEAR };
    assert!(message(good, 1.0, 0.01, 5, &negative).contains("tolerance[2]"));
    assert!(message(good, 1.0, 10.0, 1000, &NEVER).starts_with("dt makes a system grow"));
    let error = system.ends(&[good; 2], 1.0, 0.01, &[1], &NEAR, &WATCH).unwrap_err();
    assert_eq!(error.to_string(), "steps must be one number for each of 2 starts, got 1");
    let error = system.ends(&[good], 1.0, 10.0, &[1000], &NEVER, &WATCH).unwrap_err();
    assert!(error.to_string().starts_with("dt makes a system grow"));
}

#[test]
fn parts_that_do_not_fit_are_named() {
    let parts = || [linear(&[6.0; 3]), linear(&[2.0; 6]), linear(&[5.0])];
    let couplings = || [line(0.8, 0.0), line(0.0, 0.9)];
    let message = |parts: &[System; 3], couplings: &[Coupling; 2], rates| {
        CoupledSystem::new(parts.each_ref(), couplings.each_ref(), rates).unwrap_err().to_string()
    };
    let mut wrong = parts();
    wrong[1].matrices[4 * 6 + 1] = 0.1;
    let expected = "arm.matrices must be zero between place and rotation, got 0.1 at arm.matrices[0, 4, 1]";
    assert_eq!(message(&wrong, &couplings(), rates()), expected);
    let mut wrong = parts();
    wrong[2] = linear(&[1.0; 3]);
    assert_eq!(
        message(&wrong, &couplings(), rates()),
        "hand.means must be over at most 1 coordinates, got 3"
    );
    let mut wrong = parts();
    wrong[0].matrices.pop();
    assert_eq!(message(&wrong, &couplings(), rates()), "eye.matrices must be of 9 elements, got 8");
    let mut wrong = couplings();
    wrong[1].near = 0.0;
    assert_eq!(message(&parts(), &wrong, rates()), "arm_hand.near must be positive and finite, got 0.0");
    let mut wrong = couplings();
    wrong[0].mixture = linear(&[1.0]).mixture;
    assert_eq!(message(&parts(), &wrong, rates()), "eye_arm.means must be over 2 coordinates, got 1");
    let wrong = Rates { beta: [1.0, f64::NAN, 1.0], ..rates() };
    assert_eq!(
        message(&parts(), &couplings(), wrong),
        "beta must be positive and finite, got NaN at beta[1]"
    );
}
