"""The stages of a search from a problem's guess, one after another."""

from colloc.search.descend import descend
from colloc.search.explore import first_optimum
from colloc.search.refine import refine
from colloc.search.solve import confirm_optimum


def optimum_near(problem):
    """The refined optimum that the search comes to from the guess."""
    return refine(descend(first_optimum(problem, problem.guess)))


def answer_near(problem):
    """The same, confirmed on the full program; not certified."""
    return confirm_optimum(first_optimum(problem, problem.guess))
