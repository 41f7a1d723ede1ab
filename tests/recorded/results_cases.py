"""Certificates, motions and files of gaits that nobody optimised: guesses in balance, of several classes, and mixtures."""

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest

from colloc import (
    Chain,
    Concertina,
    Corners,
    CrawlerBody,
    Fourier,
    Friction,
    Harmonic,
    ModalBody,
    Polygon,
    Problem,
    Wave,
    ellipse,
)
from colloc.bounds import sampled
from colloc.bounds.optimality_gap import gap_line, upper_bound
from colloc.bounds.sampled import QUICK, THOROUGH, Bound, Budget
from colloc.gaits.relaxed import Mixture
from colloc.mechanics.actuators import UNLIMITED
from colloc.reduced import second_order
from colloc.reduced.second_order import Curvature
from colloc.search import certify as certificate
from colloc.results.answer import Alternative, SearchStep
from colloc.results.archive import KIND, VERSION, StartName, save_archive
from colloc.results.checks import UNCERTIFIED, Check
from colloc.results.distinct_optima import SAME_GAIT, SAME_VALUE, SERIES_HARMONICS, basins
from colloc.results.relaxation import Optimality, Relaxation
from colloc.results.store import FORMAT, FORMAT_VERSION, load, save
from colloc.search.certify import _second_order, certify, gait_certificate
from colloc.search.realise import STATIONARY, kept_inside, realised_gaits
from colloc.system import row_file, store_file
from colloc.system.early_interruption import INTERRUPTED
from colloc.system.sealed_file import SEAL_SIZE
from colloc.verification import refinement
from tests.conftest import guess_in_balance
from tests.shared import store_samples

PRECISION, FLOOR = 1e-6, 1e-8

AT = {"delta": 1e-2, "delta_start": 1e-2, "mesh_tolerance": 0.0}
SQUARE = Corners(np.array([[0.9, -0.3, -0.9, 0.3], [0.2, 0.8, -0.2, -0.8]]))
TRIANGLE = Mixture(
    np.array([[0.1, 0.0, 0.2], [0.1, 0.2, 0.0], [0.0, 0.1, 0.1]]),
    np.array(
        [[[1.0, 0.0], [0.6, 0.8], [-1.0, 0.0]], [[1.0, 0.0], [-0.6, -0.8], [0.0, 1.0]], [[0.0, 1.0], [0.0, 1.0], [-1.0, 0.0]]]
    ),
    np.array([0.3, -0.2]),
)


@cache
def _solutions():
    limits = {"objective": "distance / (work + driven_work)", "torque_limit": 0.3, "power_limit": (0.5, 0.6)}
    stated = (
        Problem("bilateral", ellipse(0.1, 1.2, 0.8), gait=Harmonic(1, "bilateral"), intervals=6, **AT),
        Problem("limited", ellipse(0, 1.2, 0.8), Chain((0.3, 0.3, 0.4)), Friction(1.7, 1, 1.3), Harmonic(1, "none"),
                intervals=9, rotation=None, at_least={"distance": 0.1, "-work": -0.01}, **limits, **AT),
        Problem("smooth", Fourier(np.zeros(2), [[0.9], [0.1]], [[0.0], [0.8]]), ModalBody(2, panels=4), Friction(3, 1, 1),
                Harmonic(1, "antipodal"), intervals=5, **AT),
        Problem("two-links", Fourier([0.1], [[0.9]], [[0.0]]), Chain((0.4, 0.6)), Friction(1, 1, 3), Harmonic(1, "none"),
                intervals=8, objective="distance / length", scheme="trapezoid", rotation=None, **AT),
    )  # fmt: skip
    return [guess_in_balance(problem) for problem in stated]


def certificates_of_guesses():
    found, left_out = [], Check("second order", 0.0, 1.0, "left out")
    for solution, second in zip(_solutions(), (None, left_out, None, left_out), strict=True):
        if solution.problem.name == "smooth":  # which takes as long as all others
            continue
        judged = certify(solution.answer, tolerance=1e-3, instants=60, second_order=second)
        lines = [(check.name, check.meaning, check.threshold, check.passed) for check in judged.checks]
        noise = ("balance at nodes", "closure", "KKT error", "constraint violation")
        values = {check.name: check.value for check in judged.checks if check.name not in noise}
        found += [lines, values, replace(judged, checks=()), judged.period, judged.facts()]
    return found


def motions_of_guesses():
    t, found = np.linspace(-0.3, 1.2, 23), []
    for solution in _solutions():
        motion = solution.sample(t)
        data = solution.to_xarray(t)
        found += [motion, solution.power(motion), solution.at_points()[1], solution.measured, solution.standing, repr(solution)]
        found += [{name: (str(data[name].dims), data[name].attrs, data[name].values) for name in data.variables}]
        found += [solution.status, solution.value, solution.delta_per_period, repr(solution.answer), repr(motion)]
        found.append([str(name) for name in solution.to_dataframe(t).columns])
    return found


def _contents(path):
    """Names, dimensions and units of everything in an HDF5 file, and the numbers."""
    found = {}

    def seen(name, thing):
        found[name] = {key: str(thing.attrs[key]) for key in sorted(thing.attrs) if key in ("units", "DIMENSION_LABELS")}
        if isinstance(thing, h5py.Dataset) and thing.dtype.kind in "biuf" and "seconds" not in name:
            found[name]["value"] = thing[()]

    with h5py.File(path) as file:
        file.visititems(seen)
        found["top"] = {
            key: str(file.attrs[key]) for key in sorted(file.attrs) if key in ("name", "kind", "version", "command")
        }
    return found


def solutions_on_the_disk():
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for k, solution in enumerate(_solutions()[1:]):
            path = save(solution, Path(folder) / f"{k}.h5")
            again = load(path)
            found += [_contents(path), again.answer.x, again.status, again.message, again.problem.hash == solution.problem.hash]
    return found


def an_archive_of_gaits_of_several_lengths():
    more = [Fourier(np.zeros(2), np.full((2, n), 0.3 / n), np.full((2, n), 0.4)) for n in (3, 1, 2)]
    with tempfile.TemporaryDirectory() as folder:
        archive = store_samples.archive(Path(folder) / "a.h5", range(0))
        outcomes = [replace(store_samples.outcome(k, 0.2 - 0.01 * k), gait=gait) for k, gait in enumerate(more)]
        archive.add({StartName("sobol", 1, k): outcome for k, outcome in enumerate(outcomes)})
        archive.add({StartName("sobol", 0, 4): replace(outcomes[1], start=4, value=0.1901)})
        distinct = basins(archive.problem, list(archive.outcomes.values()))
        return _contents(save_archive(archive, "colloc multistart")), [(b.starts, b.frequency, repr(b)) for b in distinct]


def mixtures():
    stated = Problem("mixture", ellipse(0, 1.2, 0.8), **AT)
    realised = realised_gaits(stated, TRIANGLE, (2, 3), tends_to=0.0)
    optimum = Optimality(0.2, 1e-4, 1e-9, -1e-3, 12)
    relaxed = Relaxation(TRIANGLE, optimum, realised[0].certificate, realised)
    wide = kept_inside(stated, Corners(4.0 * SQUARE.corners))
    found = [(r.repeats, r.sense, r.gait.corners, r.corners, r.line()) for r in realised]
    return found, wide.corners, relaxed.message, list(relaxed.lines())


def a_certificate_of_a_polygon():
    stated = Problem("p", SQUARE, Chain(width=0.05), gait=Polygon(4, "none"), torque_limit=0.1, **AT)
    judged = gait_certificate(stated, SQUARE, 0.05, SQUARE.corner_phases, 160, 1e-3, claimed=0.1)
    return str(judged), repr(judged), [check.line() for check in judged.checks]


# fmt: off
CURVATURES = (
    (0.5, 0.01, 3, 0), (1e-5, 1e-6, 3, 0), (0.02, 0.03, 2, 0), (-0.02, 1e-4, 3, 0), (-0.0101, 2e-4, 3, 0), (1.0, 0.0, 0, 0),
    (1.0, 0.1, 3, 0.011), (1.0, 0.1, 3, 0.009),
)
# fmt: on


def verdicts_of_second_order():
    """The same solution with curvatures of every kind."""
    solution, found = _solutions()[0], []
    size = abs(solution.answer.value)
    with pytest.MonkeyPatch.context() as patch:
        for smallest, error, free, slope in CURVATURES:
            known = Curvature(
                smallest=smallest * size, error=error * size, n_free=free, direction=np.zeros(2), kkt_error=slope * size
            )
            patch.setattr(second_order, "curvature", lambda program, v, known=known: known)
            found.append(_second_order(solution))
    return found


def words():
    """What is said of bounds, levels, steps of a search and other optima."""
    bilateral, limited, smooth, _ = _solutions()
    bound = Bound(0.3, 0.29, True, None, "sampled", (0.1,), (1.0,), 2.0, 4, (1, 3), (0.0,), 12, 1.0)
    cases = ((bilateral.problem, bound), (bilateral.problem, replace(bound, guaranteed=0.31)), (bilateral.problem, None))
    said = [gap_line(problem, 0.26, known) for problem, known in (*cases, (limited.problem, None), (smooth.problem, None))]
    said += [str(SearchStep("starts", 3, 10, 0.25, delta)) for delta in (0.0, 1e-3)]
    said += [str(Alternative(0.25, 1e-3, n, floor, bilateral.gait)) for n, floor in ((1, False), (2, True))]
    said += [upper_bound(each.problem, Path("/nowhere"), compute=False) for each in (limited, smooth)]
    return [*said, repr(UNCERTIFIED), str(UNCERTIFIED), str(UNCERTIFIED.facts())]


def what_is_not_said_is_this():
    """Defaults, thresholds of verdicts, and limits of files: what others rely on without naming it."""
    parts = Chain(), Friction(), ModalBody(), CrawlerBody(), Concertina(), Wave(), Budget(), QUICK, THOROUGH, UNLIMITED
    verdicts = [
        vars(certificate)[name] for name in ("KKT", "VIOLATION", "RESIDUAL", "CLOSURE", "ROTATION", "ADMISSIBLE", "GAP")
    ]
    verdicts += [certificate.WORK, certificate.MOTIONS, certificate.SADDLE, certificate.FLAT, certificate.NEAR]
    verdicts += [refinement.VIOLATION, refinement.TURNING, refinement.AIM, refinement.GRADE, SAME_VALUE, SAME_GAIT, STATIONARY]
    files = store_file.LARGEST_FILE, store_file.LARGEST_ARRAY, store_file.LONGEST_TEXT, row_file.LARGEST_ROW, SEAL_SIZE
    return parts, verdicts, files, (FORMAT, FORMAT_VERSION, KIND, VERSION, sampled.VERSION, SERIES_HARMONICS, INTERRUPTED)
