"""Replays, adaptive panels, errors of meshes, planned meshes, slopes: gaits of several bodies, laws
and symmetries."""

import numpy as np

from colloc import Chain, Corners, Fourier, Friction, Harmonic, ModalBody, Polygon, Problem, ellipse
from colloc.gaits.control_problem import control_problem
from colloc.gaits.objective import Objective
from colloc.mechanics.densities import DRIVEN_WORK, torque_and_power
from colloc.motion.followed_motion import BACKWARDS, followed_motion
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.measured import measured
from colloc.verification.adaptive_motion import fine_motion
from colloc.verification.kinks import kink_phases
from colloc.verification.mesh_error import mesh_error
from colloc.verification.refinement import planned_mesh
from colloc.verification.replay import replay
from colloc.verification.slope import slope_motion
from colloc.verification.trajectory import plan_trajectory

PRECISION, FLOOR = 1e-6, 1e-11

SKEW = Fourier([0.3, -0.2], [[1.2], [0.3]], [[0.2], [1.0]])
FOUR = Fourier(
    [0.1, 0.0, -0.2], [[0.8, 0.1], [0.2, 0.0], [-0.7, 0.1]], [[0.1, 0.0], [0.9, 0.2], [0.2, -0.1]]
)
SQUARE = Corners(np.array([[0.9, -0.3, -0.9, 0.3], [0.2, 0.8, -0.2, -0.8]]))
OPEN = Fourier([-0.7, -0.4], [[0.3, -0.5], [-0.4, -0.2]], [[-1.6, -0.2], [-0.7, 2.7]])
"""Runs through shapes with several motions where friction is a hundred times as large across the
links as along them."""
LOPSIDED = Chain((0.25, 0.45, 0.3))
WEIGHTY = Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
UNEQUAL = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)


def replay_of_equal_coefficients():
    return replay(Chain(), Friction(), ellipse(0.0, 2.8, 1.25), 1e-3, instants=160, tolerance=1e-5)


def replay_of_unequal_coefficients_with_limits():
    limits = torque_and_power((0.1, 0.2), (0.3, 0.2))
    settings = {"instants": 200, "tolerance": 1e-4, "quantities": ["driven_work"], "limits": limits}
    return replay(WEIGHTY, UNEQUAL, SKEW, 1e-3, **settings)


def replay_with_corners():
    return replay(
        LOPSIDED,
        Friction(mu_t=3.0, mu_f=1.0, mu_b=1.0),
        SQUARE,
        1e-3,
        instants=120,
        tolerance=1e-4,
        breaks=SQUARE.corner_phases,
    )


def replays_of_other_objectives():
    """The error is that of the objective."""
    aims = Objective("turning"), Objective("driven efficiency"), Objective("distance / length")
    return [
        replay(Chain(), UNEQUAL, SKEW, 1e-2, instants=80, tolerance=1e-2, objective=aim)
        for aim in aims
    ]


def replay_where_several_motions_are_balanced():
    at = Chain(), Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0), OPEN, 1e-4
    return replay(*at, instants=200, tolerance=1e-3), replay(
        *at, instants=200, tolerance=1e-3, sense=BACKWARDS
    )


def motions_that_are_followed():
    t = np.arange(120) / 120
    found = followed_motion(Chain(), Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0), *OPEN(t), 1e-4)
    assert found.apart.any()
    return found


def replay_of_a_smooth_body():
    gait = Fourier(np.zeros(3), [[1.0], [0.0], [0.2]], [[0.0], [0.9], [0.1]])
    return replay(
        ModalBody(modes=3),
        Friction(mu_t=4.0, mu_f=1.0, mu_b=1.0),
        gait,
        1e-2,
        instants=40,
        tolerance=1e-3,
    )


def measured_for_vanishing_delta():
    return measured(
        Chain(), UNEQUAL, SKEW, 1e-2, tolerance=1e-4, instants=200, quantities=["driven_work"]
    )


def adaptive_panels():
    fine = fine_motion(
        FOUR_LINKS, UNEQUAL, FOUR, 1e-3, np.linspace(0, 1, 13), 1e-5, quantities=[DRIVEN_WORK]
    )
    t = np.random.default_rng(1).uniform(size=20)
    return (
        fine,
        fine.at(t),
        fine.velocity(t.reshape(4, 5)),
        kink_phases(FOUR_LINKS, UNEQUAL, FOUR, 1e-3, fine),
    )


FOUR_LINKS = Chain((0.2, 0.3, 0.3, 0.2))


def _plans(stated, gait, tolerances=(1e-3, 1e-5)):
    mesh = control_problem(stated).mesh()
    plans = [
        planned_mesh(control_problem(stated), mesh, gait, stated.delta, tolerance, most_points=600)
        for tolerance in tolerances
    ]
    return mesh_error(control_problem(stated), mesh, gait, stated.delta, 1e-5), plans


def meshes_for_a_bilateral_gait():
    gait = ellipse(0.0, 2.8, 1.25)
    return _plans(
        Problem(
            "p", gait, gait=Harmonic(1, "bilateral"), delta=1e-3, delta_start=1e-3, intervals=8
        ),
        gait,
    )


def meshes_for_an_antipodal_gait_of_unequal_coefficients():
    gait = Fourier(np.zeros(2), [[1.5], [0.2]], [[0.0], [1.1]])
    stated = {
        "gait": Harmonic(1, "antipodal"),
        "scheme": "radau-3",
        "objective": "distance / (work + driven_work)",
    }
    return _plans(
        Problem("p", gait, LOPSIDED, UNEQUAL, delta=1e-3, delta_start=1e-3, intervals=9, **stated),
        gait,
    )


def meshes_for_a_gait_without_symmetry():
    stated = {
        "gait": Harmonic(2, "none"),
        "scheme": "hermite-simpson",
        "objective": "distance / length",
        "rotation": None,
    }
    return _plans(
        Problem(
            "p", FOUR, FOUR_LINKS, UNEQUAL, delta=1e-2, delta_start=1e-2, intervals=11, **stated
        ),
        FOUR,
    )


def meshes_for_a_polygon():
    """One without symmetry: of two panels that are each other's images rounding says which is
    halved."""
    uneven = Corners(np.array([[0.9, -0.3, -0.8, 0.4], [0.2, 0.7, -0.3, -0.8]]))
    stated = Problem(
        "p",
        uneven,
        gait=Polygon(4, "none"),
        delta=1e-2,
        delta_start=1e-2,
        intervals=8,
        joint_limit=0.92,
    )
    return _plans(stated, uneven)


def an_uneven_mesh():
    gait = ellipse(0.0, 2.8, 1.25)
    stated = Problem(
        "p", gait, gait=Harmonic(1, "bilateral"), delta=1e-3, delta_start=1e-3, intervals=8
    )
    mesh = Mesh(scheme("gauss-4"), np.array([0.0, 0.04, 0.11, 0.2, 0.25]))
    kept = np.array([0.13])
    return (
        mesh_error(control_problem(stated), mesh, gait, 1e-3, 1e-4),
        planned_mesh(
            control_problem(stated), mesh, gait, 1e-3, 1e-4, kept=kept, aim=0.6, most_points=90
        ),
    )


def gaits_on_slopes():
    """As exact as is needed for digits that do not depend on how the solver steps."""
    steep = slope_motion(WEIGHTY, UNEQUAL, SKEW, 0.1, 0.4, heading=1.0, periods=2, tolerance=1e-6)
    corners = slope_motion(
        Chain(),
        Friction(),
        SQUARE,
        0.1,
        0.2,
        theta=0.3,
        tolerance=1e-6,
        breaks=SQUARE.corner_phases,
    )
    names = ("course", "headings", "climb", "aside", "friction_work", "joint_work", "steering")
    return [np.round(getattr(ran, name), 4) for ran in (steep, corners) for name in names], repr(
        corners
    )


def trajectories():
    return [
        plan_trajectory(SKEW, 50.0, limits=(2.0, 1.5)),
        plan_trajectory(SKEW, 20.0, 9.0, limits=2.0),
        plan_trajectory(FOUR, 10.0, 4.05),
    ]
