"""Functions that are repeated in a program."""

import numpy as np

from colloc.numerics.repeated import Program


def test_one_variable_in_two_places_of_a_function_has_both_mixed_derivatives():
    """Of x y, which is then x squared."""
    program = Program(2)
    product = program.repeat(lambda x, y: x * y, [np.array([0, 0]), np.array([0, 1])])
    program.objective = program.pick(product[0, :1])
    program.add("other", program.pick(product[0, 1:]))
    hessian = program.nlp.functions["hess_lag"]([3.0, 5.0], 1.0, 1.0, 10.0)
    np.testing.assert_array_equal(np.array(hessian), [[2.0, 10.0], [0.0, 0.0]])
