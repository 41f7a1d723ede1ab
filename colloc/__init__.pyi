# Public names for type checkers, in the order of use; colloc/__init__.py says the same.
__version__: str
_HOME: dict[str, str]

from colloc.gaits.problem import Problem as Problem
from colloc.gaits.problem_file import Reference as Reference, load_problem as load_problem
from colloc.gaits.objective import Objective as Objective
from colloc.mechanics.chain import Chain as Chain
from colloc.gaits.coupled import Coupled as Coupled
from colloc.mechanics.floor_contact import Foot as Foot, Pad as Pad, Wheel as Wheel
from colloc.mechanics.densities import PathLimit as PathLimit
from colloc.mechanics.densities import Quantity as Quantity
from colloc.smooth.smooth_body import ModalBody as ModalBody
from colloc.smooth.smooth_body import Concertina as Concertina
from colloc.smooth.smooth_body import CrawlerBody as CrawlerBody
from colloc.smooth.smooth_body import Wave as Wave
from colloc.mechanics.friction import Axle as Axle
from colloc.mechanics.friction import Friction as Friction
from colloc.laws.resistance import Elliptic as Elliptic
from colloc.laws.resistance import Viscous as Viscous
from colloc.laws.resistance import PowerLaw as PowerLaw
from colloc.laws.own_law import (
    OwnLaw as OwnLaw,
    fitted_friction as fitted_friction,
    FittedFriction as FittedFriction,
)
from colloc.gaits.harmonic import Harmonic as Harmonic, Serpenoid as Serpenoid
from colloc.gaits.harmonic import Fourier as Fourier, ellipse as ellipse
from colloc.gaits.regime import Free as Free
from colloc.gaits.robot import Robot as Robot
from colloc.gaits.bspline import BSpline as BSpline, Polygon as Polygon
from colloc.gaits.bspline import Basis as Basis, Corners as Corners
from colloc.studies.solve import solve as solve, multistart as multistart, Starts as Starts
from colloc.studies.sweep import sweep as sweep
from colloc.studies.study import Study as Study, Axis as Axis
from colloc.studies.families import pareto_front as pareto_front, steer as steer
from colloc.results.solution import Solution as Solution
from colloc.results.store import load as load, save as save
from colloc.pictures.export import Servo as Servo
from colloc.search.evaluate import evaluate as evaluate
from colloc.search.evaluate import identify as identify
from colloc.search.certify import certify as certify
from colloc.verification.replay import replay as replay
from colloc.verification.differential_motion import slope_motion as slope_motion
from colloc.verification.differential_motion import motion_from_rest as motion_from_rest
from colloc.dynamics.dynamics import slow_enough as slow_enough
from colloc.mechanics.fixed_point import solve_balance as solve_balance
from colloc.system.errors import (
    CollocError as CollocError,
    NotConvergedError as NotConvergedError,
    ProblemError as ProblemError,
    StoreError as StoreError,
)
