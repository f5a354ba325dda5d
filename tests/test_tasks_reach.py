"""The reach: it arrives, by what the eyes see and by the motors alone, and says so when it cannot."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from motorprime import ArgumentError, Attention, Error, KinematicProjection, PinholeProjection
from motorprime.control.reaching import HAND, STANDOFF
from motorprime.kinematics import apply
from motorprime.sim.cameras import Eyes
from motorprime.sim.glass import Glass
from motorprime.sim.scene import Layout, Scene
from motorprime.sim.world import World, pybullet
from motorprime.tasks.cycle import Settings
from motorprime.tasks.reach import PERIOD, Reach
from motorprime.tasks.seeker import BACK_OFF
from motorprime.tasks.simulated import SimulatedBody
from motorprime.tasks.staging import Stage, strike_start, target_of
from motorprime.tasks.trial import BENCH, TOLERANCE, Trial
from painted_body import BEYOND, GLASS, IN_REACH, PaintedBody, target
from poseless import Poseless, Wavy

pytestmark = pytest.mark.sim

SEED = 2
QUICK = Settings(compare=False)


def painted(robot, cloud, glass=IN_REACH, *, seed=1, settings=QUICK, through=lambda known: known, **options):
    body = PaintedBody(robot, glass)
    attention = Attention(through(KinematicProjection(robot)), cloud=cloud)
    return Reach(body, target(), attention, BENCH, settings=settings, seed=seed, **options)


def estimates(cycles):
    return [None if cycle.estimate is None else tuple(cycle.estimate) for cycle in cycles]


# On a body that has no simulator.


def test_it_reaches_on_any_body(icub, cloud):
    task = painted(icub, cloud)
    cycles = list(task.run())
    assert (task.outcome, task.reason) == ("reached", "")
    np.testing.assert_allclose(task.estimate, IN_REACH, atol=4e-3)
    palm = task.solver.palm(task.body.read(task.solver.names))
    assert np.linalg.norm(palm[:3, 3] - task.pregrasp.point(IN_REACH)) < TOLERANCE
    assert np.linalg.norm((palm[:3, 3] - IN_REACH)[:2]) == pytest.approx(STANDOFF, abs=5e-3)
    assert palm[:3, 2] @ task.pregrasp.facing > np.cos(np.deg2rad(15.0))
    phases = [cycle.phase for cycle in cycles]
    assert phases == sorted(phases, key=["search", "fixate", "reach"].index)
    assert set(phases) == {"search", "fixate", "reach"}


def test_that_body_never_loads_the_simulator(icub):
    script = f"""
import sys
sys.modules["pybullet"] = None
sys.path.insert(0, {str(sys.path[0])!r}); sys.path.insert(0, "tests")
from motorprime import ICUB, Attention, KinematicProjection, ReachCloud
from motorprime.tasks.cycle import Settings
from motorprime.tasks.seeker import BACK_OFF
from motorprime.tasks.reach import PERIOD, Reach
from painted_body import BENCH, PaintedBody, target
robot = ICUB.with_urdf({str(icub.urdf)!r})
attention = Attention(KinematicProjection(robot), cloud=ReachCloud(robot))
task = Reach(PaintedBody(robot), target(), attention, BENCH, settings=Settings(compare=False), seed=1)
for _ in task.run(): pass
assert not [name for name in sys.modules if name.startswith("motorprime.sim")]
print(task.outcome)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("reached\n", "")


def test_the_same_seed_gives_the_same_run_and_another_seed_another(icub, cloud):
    runs = [list(painted(icub, cloud, seed=seed).run()) for seed in (3, 3, 4)]
    first, again, other = runs
    assert estimates(first) == estimates(again)
    np.testing.assert_array_equal([c.palm for c in first], [c.palm for c in again])
    assert estimates(first) != estimates(other)


def test_the_comparison_beside_it_never_influences_it(icub, cloud):
    runs, moves = [], []
    for compare in (False, True):
        task = painted(icub, cloud, seed=3, settings=replace(QUICK, compare=compare))
        runs.append(list(task.run()))
        moves.append(task.body.moves)
    without, beside = runs
    assert moves[0] == moves[1]
    assert estimates(without) == estimates(beside)
    for first, second in zip(without, beside, strict=True):
        assert first.full is None
        assert second.full is not None
        for camera, where in first.sight.where.items():
            np.testing.assert_array_equal(where.centres, second.sight.where[camera].centres)


def test_the_times_are_the_clock_s(icub, cloud):
    ticks = iter(range(10**6))
    task = painted(icub, cloud, clock=lambda: float(next(ticks)))
    for cycle in task.run():
        looking = {"landscape and sampling"} if cycle.phase == "reach" else {"landscape", "sampling"}
        assert set(cycle.seconds) == {"projection", *looking, "detection", "triangulation"}
        assert all(seconds == 1.0 for seconds in cycle.seconds.values())


def test_without_a_glass_it_gives_up_and_never_reaches(icub, cloud):
    task = painted(icub, cloud, None, settings=Settings(patience=2, postures=3, compare=False))
    start = task.body.read(task.solver.names)
    cycles = list(task.run())
    assert task.outcome == "not found"
    assert "3 postures of 2 cycles" in task.reason
    assert {cycle.phase for cycle in cycles} == {"search"}
    assert all(cycle.estimate is None and cycle.goal is None for cycle in cycles)
    assert task.estimate is None
    assert task.pregrasp is None
    np.testing.assert_array_equal(task.body.read(task.solver.names), start)


def test_a_hand_in_the_way_is_put_aside_and_nothing_else(icub, cloud):
    task = painted(icub, cloud, None, settings=Settings(patience=1, postures=5, compare=False))
    list(task.run())
    moved = [move for move in task.body.moves if "r_elbow" in move]
    assert moved
    np.testing.assert_allclose(task.body.read(icub.torso), icub.resting(icub.torso), atol=1e-3)
    palm = task.solver.palm(task.body.read(task.solver.names))
    np.testing.assert_allclose(palm[:3, 3], icub.aside, atol=0.08)  # roughly: out of the way is enough
    assert apply(palm, HAND)[:, 2].min() > BENCH.height


def test_a_hand_that_something_blocks_on_its_way_aside_backs_off(icub, cloud):
    task = painted(icub, cloud, None, settings=Settings(patience=1, postures=5, compare=False))
    body, move = task.body, task.body.move
    commanded = []

    def blocked(targets, seconds):
        if "r_elbow" not in targets:
            move(targets, seconds)
            return
        commanded.append(np.array([targets[name] for name in task.solver.names]))
        turn = body.read(task.solver.names) if 8 < len(commanded) < 14 else commanded[-1]
        move(dict(zip(task.solver.names, map(float, turn), strict=True)), seconds)

    body.move = blocked
    list(task.run())
    met = len(commanded) - 1 - BACK_OFF
    assert 8 <= met < 13
    # The same way back, and no farther.
    np.testing.assert_array_equal(commanded[met + 1 :], commanded[met - 1 : met - 1 - BACK_OFF : -1])
    assert np.linalg.norm(task.solver.palm(commanded[-1])[:3, 3] - icub.aside) > 0.1


def test_out_of_reach_is_refused_before_the_arm_moves(icub, cloud):
    task = painted(icub, cloud, BEYOND, settings=Settings(compare=False, postures=3))
    start = task.body.read(task.solver.names)
    cycles = list(task.run())
    assert task.outcome == "refused"
    assert "out of reach" in task.reason
    np.testing.assert_allclose(task.estimate, BEYOND, atol=0.03)  # it was seen all the same
    np.testing.assert_array_equal(task.body.read(task.solver.names), start)
    assert not any(name in move for move in task.body.moves for name in task.solver.names)
    assert "reach" not in {cycle.phase for cycle in cycles}
    assert task.pregrasp is None


def test_it_says_missed_when_the_arm_does_not_follow(icub, cloud):
    task = painted(icub, cloud)
    body, move = task.body, task.body.move

    def stuck(targets, seconds):
        move({n: body.read((n,))[0] if n == "r_elbow" else t for n, t in targets.items()}, seconds)

    body.move = stuck
    list(task.run())
    assert task.outcome == "missed"
    assert "mm from its goal" in task.reason


def test_it_may_be_stopped_at_any_cycle(icub, cloud):
    task = painted(icub, cloud)
    run = task.run()
    next(run)
    run.close()
    assert task.outcome == "running"


def test_it_reaches_with_pixels_alone(icub, cloud):
    """By a projection that knows neither poses nor depths it does what it does with them."""
    task = painted(icub, cloud, through=Poseless)
    list(task.run())
    assert (task.outcome, task.reason) == ("reached", "")
    np.testing.assert_allclose(task.estimate, IN_REACH, atol=4e-3)
    palm = task.solver.palm(task.body.read(task.solver.names))
    assert np.linalg.norm(palm[:3, 3] - task.pregrasp.point(IN_REACH)) < TOLERANCE


@pytest.mark.parametrize("wave", range(2))
def test_a_projection_that_errs_by_pixels_costs_millimetres_when_that_is_known(icub, cloud, wave):
    """4 pixels of smooth error, another one in each eye: where the glass stands on is known better."""
    task = painted(
        icub,
        cloud,
        through=lambda known: Wavy(known, 4.0, len(icub.gaze), seed=wave),
        settings=replace(QUICK, slack=4.0),
    )
    list(task.run())
    assert (task.outcome, task.reason) == ("reached", "")
    assert task.estimate[2] == pytest.approx(IN_REACH[2], abs=1e-12)
    assert np.linalg.norm(task.estimate - IN_REACH) < 0.02
    palm = task.solver.palm(task.body.read(task.solver.names))
    assert np.linalg.norm(palm[:3, 3] - task.pregrasp.point(IN_REACH)) < 0.02


def test_the_target_is_taken_to_stand_on_the_bench_only_where_the_projection_errs(icub, cloud):
    exact, erring = (painted(icub, cloud, settings=replace(QUICK, slack=slack)) for slack in (0.0, 2.0))
    assert (exact.finder.level, exact.finder.slack) == (None, 0.0)
    assert (erring.finder.level, erring.finder.slack) == (BENCH.height + GLASS.height / 2, 2.0)


def test_a_projection_to_other_images_is_refused(icub, cloud):
    larger = KinematicProjection(icub.with_image_size(640, 480))
    one_eyed = PinholeProjection({"left": np.eye(3, 4)}, (240, 320))
    for projection in (larger, one_eyed):
        with pytest.raises(ArgumentError, match=r"attention: .* of robot 'iCub' expected"):
            Reach(PaintedBody(icub), target(), Attention(projection, cloud=cloud), BENCH)


# In physics.


@pytest.mark.parametrize("seed", [-1, 1.5, True])
def test_a_seed_that_is_none_is_refused_by_name(icub, cloud, seed):
    with pytest.raises(Error, match="seed"):
        painted(icub, cloud, seed=seed)


def test_with_nothing_to_reach_over_the_bench_it_gives_up_quietly(icub, cloud):
    """No reachable place lies over a bench above the robot's head: the gaze then stays where it is."""
    task = painted(icub, cloud, glass=None)
    task.solver.bench = replace(BENCH, height=2.0)
    assert all(cycle.estimate is None for cycle in task.run())
    assert task.outcome == "not found"


@pytest.fixture(scope="module")
def run(icub, cloud):
    """A whole trial; while the task ran, nothing could be teleported and no pose of the glass be read."""
    with Trial(icub, SEED, cloud=cloud, settings=QUICK) as trial, pytest.MonkeyPatch.context() as patch:
        world, truth = trial.stage.world, trial.stage.scene.glass_pose
        glass = trial.stage.scene.glass

        def forbidden(*args, **kwargs):
            pytest.fail("the task used what only the experimenter may")

        def of_others(body, *args, **kwargs):
            assert body != glass
            return pose_of(body, *args, **kwargs)

        pose_of = pybullet.getBasePositionAndOrientation
        patch.setattr(Scene, "glass_pose", forbidden)
        patch.setattr(World, "place", forbidden)
        for name in ("resetJointState", "resetBasePositionAndOrientation", "resetBaseVelocity"):
            patch.setattr(pybullet, name, forbidden)
        patch.setattr(pybullet, "getBasePositionAndOrientation", of_others)
        start = world.read(trial.task.solver.names)
        speeds, cycles = [], []
        for cycle in trial.task.run():
            cycles.append(cycle)
            speeds.append(max(abs(s[1]) for s in joint_states(world)))
        patch.undo()
        yield SimpleNamespace(
            trial=trial,
            cycles=cycles,
            start=start,
            speeds=speeds,
            centre=truth()[0],
            verdict=trial.judge(),
            palm=world.palm_pose(),
        )


def joint_states(world):
    return world.bullet.getJointStates(world.body, list(world.joint_index.values()))


def test_the_forbidden_calls_would_be_noticed(icub):
    with World(icub) as world, pytest.MonkeyPatch.context() as patch:
        patch.setattr(pybullet, "resetJointState", lambda *args, **kwargs: pytest.fail("noticed"))
        with pytest.raises(pytest.fail.Exception, match="noticed"):
            world.bullet.resetJointState(world.body, 0, 0.0)


def test_it_reaches_through_physics(run):
    assert run.verdict.outcome == "reached"
    assert run.verdict.reached
    assert run.verdict.palm_error_m < TOLERANCE
    assert run.verdict.glass_error_m < TOLERANCE


def test_the_verdict_is_right_about_the_truth(run):
    facing = run.trial.task.pregrasp.facing
    point = run.centre - STANDOFF * facing
    error = np.linalg.norm(run.palm[:3, 3] - point)
    assert run.verdict.palm_error_m == pytest.approx(error)
    assert error < TOLERANCE
    assert facing[2] == 0.0
    assert np.linalg.norm(facing) == pytest.approx(1.0)


def test_nothing_was_touched_and_the_glass_stands_where_it_stood(run):
    assert run.verdict.touched == ()
    np.testing.assert_allclose(run.centre[:2], run.trial.stage.layout.glass_xy, atol=1e-3)


def test_the_joints_moved_by_motors_at_speeds_of_the_real_ones(run):
    assert 0.1 < max(run.speeds) < 6.0
    end = run.trial.stage.world.read(run.trial.task.solver.names)
    assert np.abs(end - run.start).max() > 0.1


def test_time_goes_on_through_the_run(run):
    times = [cycle.time for cycle in run.cycles]
    assert times == sorted(times)
    reach = [cycle.time for cycle in run.cycles if cycle.phase == "reach"]
    periods = np.diff(reach)
    assert periods.min() > PERIOD - 1e-9
    assert np.median(periods) == pytest.approx(PERIOD)  # longer only where a joint has far to turn


def test_it_saw_little_and_knew_the_glass_only_by_seeing(run):
    seen = False
    for cycle in run.cycles:
        seen = seen or cycle.sight.located is not None
        assert (cycle.estimate is not None) == seen
        assert cycle.sight.attended < 0.6
    assert seen


def test_the_plan_ends_at_the_glass_and_is_drawn_where_it_projects(run):
    task = run.trial.task
    for cycle in run.cycles:
        if cycle.phase != "reach":
            assert cycle.path is None
            continue
        assert cycle.path.shape == (50, 3)
        expected = task.projection.project(cycle.path, cycle.joints)
        for camera, pixels in cycle.path_pixels.items():
            np.testing.assert_array_equal(pixels, expected[camera])
    last = run.cycles[-1]
    np.testing.assert_allclose(last.path[-1], last.estimate, atol=0.01)


def test_comparison_and_seed_hold_in_physics_too(icub, cloud, run):
    with Trial(icub, SEED, cloud=cloud, settings=Settings(compare=True)) as trial:
        some = []
        for cycle in trial.task.run():
            some.append(cycle)
            if len(some) == min(len(run.cycles), 8):
                break
    for ours, theirs in zip(some, run.cycles, strict=False):
        np.testing.assert_array_equal(ours.joints, theirs.joints)
        np.testing.assert_array_equal(ours.palm, theirs.palm)
        np.testing.assert_array_equal(ours.images["left"], theirs.images["left"])
    assert estimates(some) == estimates(run.cycles[: len(some)])


def test_a_glass_beyond_reach_is_refused_in_physics_before_the_arm_moves(icub, cloud):
    generator = np.random.default_rng(3)
    with Stage(icub, Layout(Glass(), (-0.56, -0.25)), noise=2.0, seed=1) as stage:
        strike_start(stage, generator)
        body = SimulatedBody(stage.world, stage.eyes)
        attention = Attention(stage.projection, cloud=cloud)
        stage.strike(look_at(stage, stage.scene.glass_pose()[0]))
        task = Reach(body, target_of(Glass()), attention, BENCH, settings=QUICK, seed=generator)
        start = stage.world.read(task.solver.names)
        list(task.run())
        assert task.outcome == "refused", task.reason
        assert "out of reach" in task.reason
        np.testing.assert_allclose(stage.world.read(task.solver.names), start, atol=5e-3)
        assert not body.touched


def look_at(stage, place):
    from motorprime.control.gaze import fixate

    robot = stage.robot
    return fixate(robot, robot.resting(robot.gaze), place)


def test_a_trial_without_a_glass_is_judged_without_one(icub, cloud):
    quick = Settings(patience=1, postures=2, compare=False)
    with Trial(icub, SEED, cloud=cloud, settings=quick, glass=False, clutter=1) as trial:
        list(trial.task.run())
        verdict = trial.judge()
    assert (verdict.outcome, verdict.reached) == ("not found", False)
    assert verdict.palm_error_m is None
    assert verdict.glass_error_m is None


def test_a_start_keeps_off_everything(icub, cloud):
    for seed in range(3):
        with Trial(icub, seed, cloud=cloud, settings=QUICK) as trial:
            assert trial.stage.world.touching() == set()
            x, y, z = trial.stage.world.palm_pose()[:3, 3]
            assert -0.32 < x < -0.12
            assert 0.0 < y < 0.35
            assert 0.0 < z < 0.22


def test_a_trial_that_cannot_be_staged_leaves_no_simulator_behind(icub, cloud, monkeypatch):
    from motorprime import StateError
    from motorprime.tasks import trial as trials

    closed = []
    close = World.close
    monkeypatch.setattr(World, "close", lambda world: (closed.append(world), close(world)))

    def fail(stage, generator):
        raise StateError("start: none")

    monkeypatch.setattr(trials, "strike_start", fail)
    with pytest.raises(StateError, match="start: none"):
        Trial(icub, 0, cloud=cloud)
    assert len(closed) == 1


def test_the_body_s_frames_are_for_the_judge(icub):
    with World(icub) as world:
        body = SimulatedBody(world, Eyes(world))
        images = body.see()
        assert set(images) == set(body.frames) == {"left", "right"}
        assert all(image.shape == (240, 320, 3) for image in images.values())
