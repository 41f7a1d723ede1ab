"""The condensed program as CasADi functions that an optimiser takes, and its solutions as points of the full program."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from colloc.collocation.reduced_space import Condensed
from colloc.collocation.transcription import Transcription
from colloc.numerics.blocks import Assembly, Block, oracles


class _Callback(ca.Callback):
    """A NumPy function of (v, delta, weights) as a CasADi one; an optimiser takes NaN as a step too far."""

    def __init__(self, name: str, shapes: list[tuple[int, int]], out: tuple[int, int], function: Callable) -> None:
        ca.Callback.__init__(self)
        self._shapes, self._out, self._function = shapes, out, function
        self.construct(name, {"enable_fd": False})

    def get_n_in(self) -> int:
        return len(self._shapes)

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._shapes[index])

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._out)

    def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
        v, *numbers = (a.full().ravel() for a in arguments)
        if not np.isfinite(v).all():
            return [ca.DM(np.full(self._out, np.nan))]
        return [ca.DM(self._function(v, *(float(a[0]) for a in numbers)))]


class CondensedProgram:
    """Variables v = (gait parameters, first orientation); rows: net rotation where nothing closes it, then the checks.

    Attributes
    ----------
    nlp, options
        What nlpsol takes; parameters as for the transcription's own `colloc.numerics.blocks.Oracles`.
    rows : slice
        The rows of the full program that are kept as inequalities.
    rotation : int, optional
        The row of the full program that closes the rotation.
    """

    def __init__(self, transcription: Transcription) -> None:
        self.transcription = transcription
        self.condensed = Condensed(transcription)
        groups, n = transcription.groups, self.condensed.n
        closes = "rotation" in groups and transcription.problem.gait.symmetry != "antipodal"
        self.rotation = groups["rotation"].start if closes else None
        self.rows = slice(groups["work"].stop, transcription.assembly.m)
        n_check = self.rows.stop - self.rows.start
        blocks = [Block(b.function, b.gather, b.scatter[self.rows], b.parameters) for b in transcription.assembly.blocks[1:]]
        # the shape speed stands in as an objective; it gets no weight
        self._checks = oracles(Assembly(n, blocks[-1], tuple(blocks), sparse.csr_matrix((n_check, n))))
        own = self._checks.nlp["p"].shape[0]

        v, p, lam_f, lam_g = (
            ca.MX.sym(name, size) for name, size in (("v", n), ("p", own), ("lam_f", 1), ("lam_g", n_check + closes))
        )
        one = (1, 1)
        at = self.condensed
        self._callbacks = {
            "values": _Callback("values", [(n, 1), one], (2, 1), at.values),
            "gradients": _Callback("gradients", [(n, 1), one], (2, n), at.gradients),
            "hessian": _Callback("hessian", [(n, 1), one, one, one], (n, n), at.hessian),
        }
        values, gradients = self._callbacks["values"](v, p[0]), self._callbacks["gradients"](v, p[0])
        check_values = ca.Function("g", [self._checks.nlp["x"], self._checks.nlp["p"]], [self._checks.nlp["g"]])(v, p)
        check_jacobian = self._checks.options["jac_g"](v, p)[1]
        check_hessian = self._checks.options["hess_lag"](v, p, 0.0, lam_g[int(closes) :])
        weight = lam_g[0] if closes else ca.MX(0)
        hessian = self._callbacks["hessian"](v, p[0], lam_f, weight)
        f, g = values[0], ca.vertcat(values[1], check_values) if closes else check_values
        jacobian = ca.vertcat(gradients[1, :], check_jacobian) if closes else check_jacobian
        self.nlp = {"x": v, "p": p, "f": f, "g": g}
        self.options = {
            "grad_f": ca.Function("nlp_grad_f", [v, p], [f, gradients[0, :].T], ["x", "p"], ["f", "grad_f_x"]),
            "jac_g": ca.Function("nlp_jac_g", [v, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l", [v, p, lam_f, lam_g], [ca.triu(hessian + check_hessian)],
                ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
            ),
        }  # fmt: skip
        t = transcription
        keep = ([self.rotation] if closes else []) + list(range(self.rows.start, self.rows.stop))
        self.kept = np.array(keep)
        self.lower, self.upper = t.constraint_lower[self.kept], t.constraint_upper[self.kept]

    def parameter_vector(self, delta: float, worst: list[np.ndarray]) -> np.ndarray:
        """delta and the checks' instants; `worst` as `Transcription.block_parameters` gives them."""
        return self._checks.parameter_vector(delta, [worst[-1], *worst[2:]])

    def estimated_multipliers(self, v: np.ndarray, delta: float) -> np.ndarray:
        """Multipliers of the kept rows: what comes closest to stationarity for the rotation, zero for the checks."""
        result = np.zeros(self.kept.size)
        if self.rotation is not None:
            objective, rotation = self.condensed.gradients(v, delta)
            result[0] = -(objective @ rotation) / max(float(rotation @ rotation), 1e-300)
        return result

    def multipliers(self, lam_g: np.ndarray, gradient: np.ndarray, jacobian: sparse.csr_matrix) -> np.ndarray:
        """Multipliers of all rows of the full program: the eliminated equations' make its dependents stationary.

        Parameters
        ----------
        lam_g : (n_kept,)
            Of the kept rows.
        gradient : (n,)
            Of the full program's objective.
        jacobian : (m, n)
        """
        t, result = self.transcription, np.zeros(self.transcription.assembly.m)
        result[self.kept] = lam_g
        dependent = t.lower < t.upper
        dependent[t.layout.parameters[:, 0]] = False
        if self.condensed.n > t.layout.parameters.shape[0]:
            dependent[t.layout.theta[0, 0]] = False
        equations = np.setdiff1d(np.arange(self.rows.start), self.kept)
        right = -(gradient + jacobian.T @ result)[dependent]
        result[equations] = splu(sparse.csc_matrix(jacobian[equations][:, dependent].T)).solve(right)
        return result
