"""What is known beforehand: it settles what the regions leave open and never makes a pose worse."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError, dataclass, replace
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import ArrayLike
from regionpose.cameras import PinholeCamera
from regionpose.solve.prior import Mount
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import setups
from benchmarks.synthetic.studies.conditions import Condition
from benchmarks.synthetic.studies.problems import (
    INITIAL_CENTER_SIGMA_M,
    INITIAL_ROTATION_SIGMA_DEG,
    StudyProblem,
    draw_problem,
)
from benchmarks.synthetic.studies.rows import displacement, judged

HALF = setups.Setup(PinholeCamera(950.0, 950.0, 593.5, 395.5, width=1188, height=792), setups.perspective_setup().poses)
"""The benchmark's camera at half its resolution, for the time it takes to draw masks."""

SEEDS = range(8)
NOISE = (0.0, 0.05, 0.2)
PRIORS = ("up", "side", "near", "initial", "up and side")

BY_CHANCE_M = 0.002
"""Two minima of one pose, told by a half to a fifth of a pixel of noise at 4 to 6 m, lie no further apart."""


@dataclass(frozen=True)
class Outcome:
    """Of one scene: whether the pose is solved, and the nearest answer, how far that misplaces the regions, how many
    answers there are.
    """

    solved: bool
    nearest_solved: bool
    nearest_m: float
    answers: int
    codes: tuple[str, ...]


def outcome(problem: StudyProblem, estimate: rp.PoseEstimate) -> Outcome:
    """What an estimate is worth."""
    answers = [estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives)]
    nearest = min(answers, key=lambda pose: displacement(problem, pose))
    solved = [bool(judged(problem, pose)["solved"]) for pose in (estimate.pose, nearest)]
    codes = tuple(warning.code for warning in estimate.warnings)
    return Outcome(solved[0], solved[1], displacement(problem, nearest), len(answers), codes)


@pytest.fixture(scope="module")
def outcomes() -> dict[str, list[Outcome]]:
    """The outcomes of the same scenes of one plane, symmetric shapes and others, by what is known."""
    found: dict[str, list[Outcome]] = {prior: [] for prior in ("nothing", *PRIORS)}
    for noise in NOISE:
        for seed in SEEDS:
            condition = Condition(noise=noise, templates="symmetric" if seed % 2 else "asymmetric")
            for prior, held in found.items():
                problem = draw_problem(HALF, replace(condition, prior=prior), seed)  # type: ignore[arg-type]
                sides = problem.camera, problem.image_regions, problem.world_regions
                held.append(
                    outcome(problem, rp.estimate_pose(*sides, prior=problem.prior, solver=rp.Solver(driver="native")))
                )
    return found


@pytest.mark.slow
@pytest.mark.parametrize("prior", PRIORS)
def test_a_prior_only_ever_helps(outcomes: dict[str, list[Outcome]], prior: str) -> None:
    """Fewer answers, none of the right ones lost, more of the first ones right."""
    without, told = outcomes["nothing"], outcomes[prior]
    for k, (before, after) in enumerate(zip(without, told, strict=True)):
        if before.nearest_solved:
            assert after.nearest_solved and after.nearest_m < before.nearest_m + BY_CHANCE_M, (k, before, after)
        assert after.solved or not (before.solved and before.answers == 1), (k, before, after)
    assert sum(after.solved for after in told) >= sum(before.solved for before in without)
    assert sum(after.answers for after in told) < sum(before.answers for before in without)


@pytest.mark.slow
@pytest.mark.parametrize("prior", ["up", "initial", "up and side"])
def test_a_prior_finds_the_poses_of_symmetric_shapes(outcomes: dict[str, list[Outcome]], prior: str) -> None:
    """All without noise, where without a prior half of the scenes are symmetric and few of those right by chance."""
    clean = slice(0, len(SEEDS))
    assert sum(before.solved for before in outcomes["nothing"][clean]) < 0.7 * len(SEEDS)
    assert all(after.solved for after in outcomes[prior][clean])
    assert not any("contradicted" in code for after in outcomes[prior][clean] for code in after.codes)


CAMERA = rp.PinholeCamera(800.0, 800.0, 640.0, 480.0, width=1280, height=960)
POSTER = np.array([[-0.8, -0.5, 0.0], [0.8, -0.5, 0.0], [0.8, 0.5, 0.0], [-0.8, 0.5, 0.0]])
POSE = rp.Pose(Rotation.from_rotvec([0.3, -0.2, 0.1]), np.array([0.1, -0.2, 3.0]))
"""The poster seen from its side z < 0, the world's -y upward."""


def seen(world: rp.WorldRegion, **options: object) -> rp.PoseEstimate:
    """The estimate from the exact image of the poster; options of the prior, and the driver."""
    image = rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(POSTER)))
    driver = options.pop("driver", "scipy")
    return rp.estimate_pose(CAMERA, [image], [world], prior=rp.Prior(**options), solver=rp.Solver(driver=driver))  # type: ignore[arg-type]


WORLD = rp.WorldRegion.from_polygon(POSTER)


def is_true(pose: rp.Pose) -> bool:
    return float((pose.rotation * POSE.rotation.inv()).magnitude()) < 1e-6


@pytest.mark.parametrize("driver", ["scipy", "native"])
def test_up_and_the_visible_side_leave_one_pose_of_a_rectangle(driver: str) -> None:
    front = WORLD.with_viewpoint([0.0, 0.0, -1.0])
    assert [len(seen(world, driver=driver).diagnostics.alternatives) for world in (WORLD, front)] == [3, 1]
    assert len(seen(WORLD, driver=driver, up=[0.0, -1.0, 0.0], up_sigma_deg=10.0).diagnostics.alternatives) == 1
    estimate = seen(front, driver=driver, up=[0.0, -1.0, 0.0])
    assert not estimate.diagnostics.alternatives and not estimate.warnings
    assert is_true(estimate.pose)


@pytest.mark.parametrize("driver", ["scipy", "native"])
def test_an_initial_pose_with_its_uncertainty_leaves_one(driver: str) -> None:
    rough = rp.Pose(Rotation.from_rotvec([0.1, 0.1, -0.1]) * POSE.rotation, POSE.translation + 0.2)
    assert len(seen(WORLD, driver=driver, initial=rough).diagnostics.alternatives) == 3
    estimate = seen(WORLD, driver=driver, initial=rough, initial_rotation_sigma_deg=10.0, initial_center_sigma_m=0.3)
    assert not estimate.diagnostics.alternatives and not estimate.warnings
    assert is_true(estimate.pose)


@pytest.mark.parametrize("driver", ["scipy", "native"])
def test_a_place_that_the_camera_is_near_leaves_one(driver: str) -> None:
    estimate = seen(WORLD, driver=driver, camera_near=POSE.camera_center + 0.1, camera_near_sigma_m=0.2)
    assert not estimate.diagnostics.alternatives and not estimate.warnings
    assert is_true(estimate.pose)


def test_a_camera_elsewhere_is_warned_of() -> None:
    """Known to 2 m without a word, 40 m above: all poses of the poster are 20 standard deviations away."""
    estimate = seen(WORLD, camera_near=POSE.camera_center + np.array([0.0, -40.0, 0.0]))
    values = {warning.code: warning.values for warning in estimate.warnings}[rp.WarningCode.CAMERA_POSITION_CONFLICT]
    away = np.linalg.norm(estimate.pose.camera_center - POSE.camera_center + np.array([0.0, 40.0, 0.0]))
    assert values == pytest.approx({"shift_m": away, "sigmas": away / 2.0}, rel=1e-3)


PARTS: list[dict[str, object]] = [
    {},
    {"up": np.array([0, 0, 1]), "up_sigma_deg": 5},
    {"up": (0.1, 0.2, 1.0 / 3.0)},
    {
        "initial": POSE,
        "initial_rotation_sigma_deg": np.float32(5.0),
        "initial_center_sigma_m": 0.1,
        "camera_near": [1, 2, 3],
    },
    {"camera_near": np.array([1.5, 2.0, 1e-9], dtype=np.float32), "camera_near_sigma_m": np.float64(0.5)},
]


@pytest.mark.parametrize("parts", PARTS)
def test_a_prior_can_be_typed_in_compared_and_pickled(parts: dict[str, object]) -> None:
    prior = rp.Prior(**parts)  # type: ignore[arg-type]
    same, typed = rp.Prior(**parts), eval(repr(prior), {"Prior": rp.Prior, "Pose": rp.Pose})  # type: ignore[arg-type]
    assert prior == same == pickle.loads(pickle.dumps(prior)) and hash(prior) == hash(same)
    assert [prior == rp.Prior(**other) for other in PARTS] == [other is parts for other in PARTS]  # type: ignore[arg-type]
    assert prior != "prior"
    if prior.initial is None:
        assert typed == prior
    else:
        # A matrix gives back the rotation to its last digit but one.
        np.testing.assert_allclose(typed.initial.matrix, prior.initial.matrix, atol=1e-15)
        assert replace(typed, initial=POSE) == prior


def test_a_prior_keeps_numbers_and_can_be_changed() -> None:
    prior = rp.Prior(up=np.array([0, 0, 1]), up_sigma_deg=5)
    assert prior.up == (0.0, 0.0, 1.0) and prior.up_sigma_deg == 5.0
    assert repr(prior) == "Prior(up=(0.0, 0.0, 1.0), up_sigma_deg=5.0)"
    assert replace(prior, up_sigma_deg=None) == rp.Prior(up=[0.0, 0.0, 1.0])
    with pytest.raises(FrozenInstanceError):
        prior.up = None  # type: ignore[misc]


def test_a_prior_about_another_origin_says_the_same() -> None:
    shift = np.array([512_300.0, 5_405_700.0, 100.0])
    prior = rp.Prior(up=[0.0, 0.0, 1.0], initial=POSE, camera_near=shift + 1.0).rebase(shift)
    assert prior.initial is not None and prior.up == (0.0, 0.0, 1.0) and prior.camera_near == (1.0, 1.0, 1.0)
    np.testing.assert_allclose(prior.initial.camera_center, POSE.camera_center - shift, atol=1e-9)


def test_each_problem_of_a_batch_has_its_prior() -> None:
    image = rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(POSTER)))
    problem = (CAMERA, [image], [WORLD])
    up, near = rp.Prior(up=[0.0, -1.0, 0.0]), rp.Prior(camera_near=POSE.camera_center, camera_near_sigma_m=0.2)
    blind = (CAMERA, [image, image], [WORLD])
    found = rp.estimate_poses([problem, blind, problem, problem], prior=[None, near, up, near])
    assert isinstance(found.pop(1), rp.PoseError)
    alone = [seen(WORLD, driver="native", **told) for told in ({}, {"up": up.up}, NEAR)]
    assert [answers(each) for each in found] == [answers(each) for each in alone]
    one, two = rp.estimate_poses([problem, problem], prior=up)
    assert answers(one) == answers(two) == answers(found[1])


NEAR = {"camera_near": POSE.camera_center, "camera_near_sigma_m": 0.2}


def answers(estimate: object) -> list[list[float]]:
    """All poses of an estimate."""
    assert isinstance(estimate, rp.PoseEstimate)
    return [
        pose.matrix.ravel().tolist()
        for pose in (estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives))
    ]


def test_convention_an_initial_poses_sigma_is_degrees_and_meters_of_the_cameras_place() -> None:
    """Carried by 1 m in the world: 10 standard deviations of 0.1 m, 2 of 0.5 m; turned by 20 deg: 10 of 2 deg."""
    carried = rp.Pose(POSE.rotation, POSE.translation - POSE.rotation.apply([0.6, 0.0, -0.8]))
    turned = rp.Pose(Rotation.from_euler("y", 20.0, degrees=True) * POSE.rotation, POSE.translation)
    turned = rp.Pose(turned.rotation, -turned.rotation.apply(POSE.camera_center))
    for initial, sigma, times in (
        (carried, (5.0, 0.1), 10.0),
        (turned, (2.0, 1.0), 10.0),
        (carried, (5.0, 0.5), None),
    ):
        sigmas = dict(zip(("initial_rotation_sigma_deg", "initial_center_sigma_m"), sigma, strict=True))
        codes = {warning.code: warning.values for warning in seen(WORLD, initial=initial, **sigmas).warnings}
        assert ("initial-pose-conflict" in codes) == (times is not None), codes
        if times is not None:
            # Regions pull the pose by a little of the prior's deviation.
            sigmas_found = codes[rp.WarningCode.INITIAL_POSE_CONFLICT]["sigmas"]
            assert sigmas_found == pytest.approx(times - 0.05, abs=0.1)


def test_a_pose_that_shows_the_other_side_is_warned_of() -> None:
    """An L from behind: its one pose stays, whatever the viewpoint says."""
    flat = [[0.0, 0.0], [0.7, 0.0], [0.7, 0.3], [0.3, 0.3], [0.3, 1.2], [0.0, 1.2]]
    ring = np.column_stack([flat, np.zeros(6)])
    image = rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(ring)))
    world = rp.WorldRegion.from_polygon(ring)
    for height, expected in ((-2.0, []), (2.0, ["viewpoint-conflict"])):
        estimate = rp.estimate_pose(CAMERA, [image], [world.with_viewpoint([0.0, 0.0, height])])
        assert [warning.code for warning in estimate.warnings] == expected
        assert is_true(estimate.pose)


def test_batches_and_pickles_know_the_viewpoint() -> None:
    front = pickle.loads(pickle.dumps(WORLD.with_viewpoint([0.0, 0.5, -1.0])))
    assert np.array_equal(front.viewpoint, [0.0, 0.5, -1.0]) and WORLD.viewpoint is None
    image = rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(POSTER)))
    [free, told] = rp.estimate_poses([(CAMERA, [image], [WORLD]), (CAMERA, [image], [front])])
    assert isinstance(free, rp.PoseEstimate) and isinstance(told, rp.PoseEstimate)
    assert (len(free.diagnostics.alternatives), len(told.diagnostics.alternatives)) == (3, 1)


def test_a_viewpoint_of_a_mesh_is_kept_by_pickling() -> None:
    bent = np.vstack([POSTER, [0.0, 0.0, -0.2]])
    mesh = _Mesh(bent, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))
    region = rp.WorldRegion.from_mesh(mesh).with_viewpoint([0.0, 0.0, -3.0])
    assert not region.is_planar
    assert np.array_equal(pickle.loads(pickle.dumps(region)).viewpoint, [0.0, 0.0, -3.0])


@dataclass
class _Mesh:
    vertices: ArrayLike
    faces: ArrayLike


def test_the_studys_priors_err_by_what_they_say() -> None:
    """Root mean squares over 60 scenes, along each axis."""
    turns, ways = [], []
    for seed in range(60):
        problem = draw_problem(HALF, Condition(prior="initial", templates="asymmetric"), seed)
        assert problem.prior is not None and problem.prior.initial is not None
        rough, scene = problem.prior.initial, problem.scene
        true = rp.Pose.from_parts(scene.rotation, scene.translation)
        turns.append(np.degrees((rough.rotation * true.rotation.inv()).as_rotvec()))
        ways.append(rough.camera_center - true.camera_center)
    for errors, sigma in ((turns, INITIAL_ROTATION_SIGMA_DEG), (ways, INITIAL_CENTER_SIGMA_M)):
        assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(sigma, rel=0.2)


MOUNTS = {"front": [1.0, 0.0, 0.0], "left": [0.0, 1.0, 0.0], "rear": [-1.0, 0.0, 0.0], "right": [0.0, -1.0, 0.0]}


@pytest.mark.parametrize("mount", MOUNTS)
def test_a_mounted_camera_is_level_and_looks_along_its_mount(mount: Mount) -> None:
    prior = rp.Prior.mounted(mount, up="z", place=[1.0, 2.0, 3.0], near_m=0.4)
    assert prior.initial is not None and prior.camera_near is None
    right, down, forward = prior.initial.rotation.as_matrix()
    assert forward == pytest.approx(MOUNTS[mount]) and down == pytest.approx([0.0, 0.0, -1.0])
    assert right == pytest.approx(np.cross([0.0, 0.0, -1.0], MOUNTS[mount]))
    assert prior.initial.camera_center == pytest.approx([1.0, 2.0, 3.0])
    assert (prior.initial_rotation_sigma_deg, prior.initial_center_sigma_m) == (20.0, 0.4)
    assert (prior.up, prior.up_sigma_deg) == ((0.0, 0.0, 1.0), 5.0)
    assert rp.Prior.mounted(mount).initial_center_sigma_m == 0.5


def test_a_mounted_camera_holds_no_more_than_is_given() -> None:
    assert rp.Prior.mounted() == rp.Prior()
    assert rp.Prior.mounted(up="-y") == rp.Prior(up=[0.0, -1.0, 0.0], up_sigma_deg=5.0)
    assert rp.Prior.mounted(up=[0.1, 0.2, 0.9]) == rp.Prior(up=[0.1, 0.2, 0.9], up_sigma_deg=5.0)
    assert rp.Prior.mounted(near_m=0.3) == rp.Prior(camera_near=[0.0, 0.0, 0.0], camera_near_sigma_m=0.3)
    assert rp.Prior.mounted(place=[1.0, 0.0, 2.0]) == rp.Prior(camera_near=[1.0, 0.0, 2.0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mount": "top"}, "mount: found 'top'; needed front, left, rear, right"),
        ({"up": "north"}, "up: found 'north'; needed x, y, z, -x, -y, -z or a vector"),
        ({"up": [0.0, 0.0, 0.0]}, "up is a zero vector"),
        ({"near_m": 0.0}, "near_m: found 0"),
        ({"mount": "left", "near_m": np.nan}, "near_m: found nan"),
        ({"mount": "left", "place": [1.0, 2.0]}, "place has shape"),
        ({"place": [1.0, np.inf, 2.0]}, "place"),
    ],
)
def test_a_mount_that_is_none_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rp.Prior.mounted(**given)
