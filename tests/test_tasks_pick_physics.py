"""Picking up in physics: by friction, by what the eyes see, and without a touch of what stands about."""

import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from motorprime import shipped
from motorprime.sim.glass import DIAMETERS, MASSES
from motorprime.sim.scene import TABLE_HEIGHT, Scene
from motorprime.sim.world import STEP, World, pybullet
from motorprime.tasks.cycle import Settings
from motorprime.tasks.disturbance import BETWEEN
from motorprime.tasks.pick_trial import AWAY, HELD, LIFTED, PickTrial

pytestmark = pytest.mark.sim

QUICK = Settings(compare=False)
PHASES = ["search", "fixate", "survey", "reach", "grasp", "lift"]


@pytest.fixture(scope="module")
def dynamics():
    return shipped.coupled_dynamics()


SEED = 0
ONLY_THE_EXPERIMENTER_S = (
    "resetJointState", "resetBasePositionAndOrientation", "resetBaseVelocity", "createConstraint",
    "changeConstraint", "changeDynamics", "applyExternalForce", "applyExternalTorque",
    "setCollisionFilterPair", "setGravity", "removeBody",
)  # fmt: skip


def of_the_judge():
    """Whether a pose is read in the file of the one who judges the trial."""
    return "pick_trial.py" in sys._getframe(2).f_code.co_filename


def trial_of(icub, cloud, dynamics, *, obstacle):
    """A whole trial; while it runs nothing is teleported or tied, and only the judge sees true poses."""
    with (
        PickTrial(icub, SEED, dynamics, obstacle=obstacle, settings=QUICK, cloud=cloud) as trial,
        pytest.MonkeyPatch.context() as patch,
    ):
        world, scene = trial.stage.world, trial.stage.scene
        things = {scene.glass, scene.obstacle, scene.table, *scene.clutter}
        place_of, touching, glass_pose = (
            pybullet.getBasePositionAndOrientation,
            pybullet.getContactPoints,
            Scene.glass_pose,
        )
        judging = []

        def forbidden(*args, **kwargs):
            pytest.fail("the task used what only the experimenter may")

        def for_the_judge(scene):
            assert of_the_judge(), "the task read where the glass is"
            judging.append(True)
            try:
                return glass_pose(scene)
            finally:
                judging.pop()

        def of_others(body, *args, **kwargs):
            assert judging or body not in things, "the task read where a thing is"
            return place_of(body, *args, **kwargs)

        seen = SimpleNamespace(bottoms=[], alone=[], torques={}, gaps=[], constraints=set())
        fingers = [j for j, terms in icub.couplings.items() if set(terms) & set(icub.hand.motors)]
        if scene.obstacle is not None:
            seen.standing = world.bullet.getBasePositionAndOrientation(scene.obstacle)

        def watch():
            client = world.bullet._client
            (_, _, z), _ = place_of(scene.glass, physicsClientId=client)
            seen.bottoms.append(z - trial.stage.layout.glass.height / 2 - TABLE_HEIGHT)
            others = {pair[2] for pair in touching(bodyA=scene.glass, physicsClientId=client)}
            seen.alone.append(others <= {world.body})
            for joint in fingers:
                seen.torques[joint] = max(seen.torques.get(joint, 0.0), abs(world.torque(joint)))
            seen.constraints.add(world.bullet.getNumConstraints())

        trial.body.watchers.append(watch)
        patch.setattr(Scene, "glass_pose", for_the_judge)
        patch.setattr(World, "place", forbidden)
        for name in ONLY_THE_EXPERIMENTER_S:
            patch.setattr(pybullet, name, forbidden)
        patch.setattr(pybullet, "getBasePositionAndOrientation", of_others)
        cycles = []
        for cycle in trial.run():
            cycles.append(cycle)
            if scene.obstacle is not None:
                near = world.bullet.getClosestPoints(world.body, scene.obstacle, 0.05)
                seen.gaps.append(min((point[8] for point in near), default=np.inf))
        patch.undo()
        yield SimpleNamespace(
            trial=trial, cycles=cycles, seen=seen, verdict=trial.judge(), world=world, scene=scene
        )


@pytest.fixture(scope="module")
def lifted(icub, cloud, dynamics):
    yield from trial_of(icub, cloud, dynamics, obstacle=False)


@pytest.fixture(scope="module")
def past_an_obstacle(icub, cloud, dynamics):
    yield from trial_of(icub, cloud, dynamics, obstacle=True)


@pytest.mark.parametrize("name", ["createConstraint", "resetBasePositionAndOrientation"])
def test_the_forbidden_calls_would_be_noticed(icub, name):
    with World(icub) as world, pytest.MonkeyPatch.context() as patch:
        patch.setattr(pybullet, name, lambda *args, **kwargs: pytest.fail("noticed"))
        with pytest.raises(pytest.fail.Exception, match="noticed"):
            getattr(world.bullet, name)(world.body, (0, 0, 0), (0, 0, 0, 1))


def test_a_glass_is_lifted_through_physics(lifted):
    verdict = lifted.verdict
    assert (verdict.outcome, verdict.reason, verdict.lifted) == ("lifted", "", True)
    assert verdict.height_m >= LIFTED
    assert verdict.glass_error_m < 0.01
    assert not verdict.touched_obstacle and not verdict.disturbed
    assert verdict.mass_kg == lifted.trial.stage.layout.glass.mass


def test_the_verdict_is_right_about_the_truth(lifted):
    """By what was noted beside it at every step of the last second."""
    last = round(HELD / STEP)
    assert min(lifted.seen.bottoms[-last:]) == pytest.approx(lifted.verdict.height_m)
    assert min(lifted.seen.bottoms[-last:]) >= LIFTED == 0.05
    assert all(lifted.seen.alone[-last:])
    assert not any(lifted.seen.alone[:100])  # it stood on the table
    assert abs(lifted.seen.bottoms[0]) < 2e-3


def test_it_is_friction_of_the_fingers_that_holds_it(lifted, icub):
    """The hand presses it from two sides, nothing is tied to anything, and surfaces are as they were."""
    assert lifted.seen.constraints == {0}
    contacts = lifted.world.contacts(lifted.scene.glass)
    assert len({contact.link for contact in contacts}) >= 2
    pushes = np.array([contact.normal for contact in contacts if contact.pressure > 0.0])
    assert (pushes @ pushes.T).min() < -0.5
    weight = 9.81 * lifted.verdict.mass_kg
    assert sum(contact.friction for contact in contacts) > 0.5 * weight
    assert lifted.world.bullet.getDynamicsInfo(lifted.scene.glass, -1)[1] <= 0.8 + 1e-9


def test_no_finger_is_stronger_than_its_motor(lifted, icub):
    limits = {
        joint.get("name"): float(joint.find("limit").get("effort"))
        for joint in ElementTree.parse(icub.urdf).getroot().iter("joint")
        if joint.find("limit") is not None
    }
    assert lifted.seen.torques
    for joint, torque in lifted.seen.torques.items():
        assert torque <= limits[joint] + 1e-6
        assert limits[joint] == pytest.approx(0.3)
    assert max(lifted.seen.torques.values()) > 0.05  # it does press


def test_in_physics_the_phases_follow_one_another_too(lifted):
    phases = [cycle.phase for cycle in lifted.cycles]
    assert phases == sorted(phases, key=PHASES.index)
    assert set(phases) == set(PHASES)


def test_it_knew_the_glass_only_by_seeing(lifted):
    seen = False
    for cycle in lifted.cycles:
        seen = seen or cycle.sight.located is not None
        assert (cycle.estimate is not None) == seen
        assert cycle.sight.attended < 0.6
    assert seen


def test_past_an_obstacle_the_glass_is_lifted(past_an_obstacle):
    verdict = past_an_obstacle.verdict
    assert (verdict.outcome, verdict.reason, verdict.lifted) == ("lifted", "", True)


def test_the_obstacle_is_not_touched_and_stays_where_it_is(past_an_obstacle):
    verdict, seen = past_an_obstacle.verdict, past_an_obstacle.seen
    assert verdict.lifted == (verdict.outcome == "lifted")
    assert not verdict.touched_obstacle
    assert "obstacle" not in verdict.touched
    assert min(seen.gaps) > 0.0
    now = past_an_obstacle.world.bullet.getBasePositionAndOrientation(past_an_obstacle.scene.obstacle)
    np.testing.assert_allclose(now[0], seen.standing[0], atol=1e-3)
    np.testing.assert_allclose(np.abs(now[1]), np.abs(seen.standing[1]), atol=1e-2)


def test_the_obstacle_was_known_by_seeing_where_it_stands(past_an_obstacle):
    ((place, _),) = past_an_obstacle.cycles[-1].obstacles
    np.testing.assert_allclose(place, past_an_obstacle.seen.standing[0], atol=0.015)
    assert next(cycle for cycle in past_an_obstacle.cycles if cycle.phase == "reach").obstacles


def test_the_staged_obstacle_stands_between_the_palm_and_the_glass(past_an_obstacle):
    start = past_an_obstacle.cycles[0].palm[:2]
    glass = np.array(past_an_obstacle.trial.stage.layout.glass_xy)
    spot = np.array(past_an_obstacle.seen.standing[0][:2])
    assert np.linalg.norm(start - glass) >= AWAY - 0.02
    share = (spot - start) @ (glass - start) / ((glass - start) @ (glass - start))
    assert BETWEEN[0] - 0.05 < share < BETWEEN[1] + 0.05


def test_the_glass_of_a_trial_is_drawn_and_named_by_its_seed(icub, lifted):
    layout = lifted.trial.stage.layout
    assert MASSES[0] <= layout.glass.mass <= MASSES[1]
    assert DIAMETERS[0] <= 2 * layout.glass.radius <= DIAMETERS[1]
    assert lifted.verdict.width_m == pytest.approx(2 * layout.glass.radius)
