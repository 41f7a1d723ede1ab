"""The stages of a search from a problem's guess, one after another."""

from colloc.search.descend import descend
from colloc.search.explore import begin_at
from colloc.search.refine import refine
from colloc.search.solve import confirmed


def optimum_near(problem):
    """The refined optimum that the search comes to from the guess."""
    return refine(descend(begin_at(problem, problem.guess)))


def answer_near(problem):
    """The same, confirmed on the full program; not certified."""
    return confirmed(begin_at(problem, problem.guess))
