"""The stages of a search from a problem's guess, one after another."""

from colloc.search.explore import first_optimum
from colloc.search.iterate import space_near
from colloc.search.optimise import descend, refine
from colloc.search.solve import confirm_optimum
from colloc.transcription.full_program import FullProgram


def program_of(problem, gait=None):
    """The full program of a problem on its first mesh, in units of friction, with shape limits at
    the worst instants of the member nearest to a gait (by default the guess)."""
    space, v = space_near(problem, problem.guess if gait is None else gait)
    return FullProgram(space.control, space.full_parameters(v))


def optimum_near(problem):
    """The refined optimum that the search comes to from the guess."""
    return refine(descend(first_optimum(problem, problem.guess)))


def answer_near(problem):
    """The same, confirmed on the full program; not certified."""
    return confirm_optimum(first_optimum(problem, problem.guess))
