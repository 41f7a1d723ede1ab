"""What IPOPT asks between iterations: whether Ctrl-C came. Stopped so, it ends at once and says nothing."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from colloc.system.interruption import interrupted


class StopRequest(ca.Callback):
    """The ``iteration_callback`` of nlpsol for a program, of which it is given x, p, f and g."""

    def __init__(self, nlp: Mapping[str, ca.MX]) -> None:
        ca.Callback.__init__(self)
        self._sparsity = {name: nlp[name.removeprefix("lam_")].sparsity() for name in ca.nlpsol_out()}
        self.construct("stop_request")

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, index: int) -> str:
        return ca.nlpsol_out(index)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return self._sparsity[ca.nlpsol_out(index)]

    def eval(self, arguments: list[ca.DM]) -> list[int]:
        return [int(interrupted())]
