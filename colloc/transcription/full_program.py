r"""The full nonlinear program of a problem, by direct collocation: what IPOPT is given.

Decision variables are the gait's parameters p; at every point of the mesh and link of a chain its
direction phi, rotation rate w, midpoint velocity v, the friction f and couple c on it, and the
force N and moment M at the joint behind it; the tail's orientation theta; distance D and work W.
Components of v, f and N are those in the axes of the plane; rates, with a prime, are per radian of
phase; delta is the sliding speed below which friction is smoothed. With link i of length l_i and
mass m_i, e_i = (cos phi_i, sin phi_i), n_i = (-sin phi_i, cos phi_i), and joint angles q = Phi(t) p
+ rest::

    max  objective(D, W, ...)
    phi_0 = theta,   phi_i - phi_(i-1) = Phi_i p,   w_i - w_(i-1) = Phi_i' p       the gait
    v_i - v_(i-1) = l_(i-1)/2 w_(i-1) n_(i-1) + l_i/2 w_i n_i                     links are joined
    f_i, c_i = friction(v_i, w_i, phi_i; delta)                                   on what touches
    N_i - N_(i+1) + f_i + m_i g = 0                                               force balance
    M_i - M_(i+1) + c_i - l_i/2 e_i x (N_i + N_(i+1)) = 0                         torque balance
    theta' = w_0,   D' = sum m_i v_i . ahead,   W' = - sum (f_i . v_i + c_i w_i)  collocated
    N = 0, M = 0 at both free ends;   D(0) = W(0) = 0;   theta(end) = +-theta(0)  boundary

Friction is stated as (f - friction)/(its secant), which is mild where the law is nearly a step.
theta, and distances of gaits that turn, are seen from axes that turn evenly. *Ahead* is +x on level
ground, where the first orientation is free, so that maximising D turns the motion there. A load g
is that of a slope. With inertia the momenta P of the body take the place of N and M::

    P = (sum m_i v_i in the tail's axes, sum J_i w_i + m_i x_i x v_i)
    P' = (sum f_i + m_i g, sum c_i + x_i x f_i) / Fr + turning of the axes        collocated

with x_i the midpoints seen from the centre of mass; where torques are limited they follow from
q'', variables too, and the momenta (`colloc.dynamics.torques`). Other bodies, and the formulation
"implicit velocity", have shape coordinates q, rates r and tail velocity z as variables, and z =
Z(q, r), the velocity that balances them, in place of friction and balance
(`colloc.transcription.velocity_map`).

Inequalities are the limits of the shape, each at the worst instant of the mesh cells in which it
may bind for a given gait; what actuators can do, at every point; and the mean shape speed. Every
row is a sparse matrix times (variables, outputs of functions of one link, contact or check that
are repeated over parts and points: `colloc.numerics.repeated`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, cast

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.heading import closing_sign, momenta_image
from colloc.dynamics.kinds import kind_of_motion
from colloc.dynamics.torques import torque_function
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.limits import widest
from colloc.gaits.period import chord_per_way
from colloc.mechanics.bodies import FULL
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import Pairs
from colloc.mechanics.densities import Instants
from colloc.mechanics.friction import LinkForce, line_integrals
from colloc.mechanics.inertia import STATES, turning
from colloc.numerics.mesh import Mesh
from colloc.numerics.repeated import Nlp, Repeated, Rows, nonlinear_program
from colloc.transcription.layout import RADIANS, Layout, layout_of
from colloc.transcription.shape_limits import ShapeLimits
from colloc.transcription.velocity_map import BalancedVelocity, velocity_map
from colloc.transcription.warm_start import balanced_variables

ACTUATORS, AT_LEAST, SHAPE_SPEED = "actuators", "at least", "shape speed"


@dataclass(frozen=True, eq=False)
class FullProgram:
    """A nonlinear program ``min f(x), lower <= x <= upper, row_lower <= g(x) <= row_upper``;
    `groups` are the rows of a name, `cells` the mesh cells of a path constraint."""

    control: ControlProblem
    mesh: Mesh
    far: Pairs
    layout: Layout
    groups: dict[str, slice]
    cells: dict[str, np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    row_lower: np.ndarray
    row_upper: np.ndarray
    repeated: tuple[Repeated, ...]
    rows: sparse.csr_matrix
    objective: sparse.csr_matrix
    limits: ShapeLimits
    velocity: BalancedVelocity | None = None
    """Kept alive here for the functions that call it."""

    @property
    def n(self) -> int:
        return self.lower.size

    @property
    def delta_unit(self) -> float:
        return 1.0 if self.control.admissible.gait.relative_delta else RADIANS

    @cached_property
    def nlp(self) -> Nlp:
        return nonlinear_program(self.n, self.repeated, self.rows, self.objective)

    def member(self, x: np.ndarray) -> AnyGait:
        return self.control.admissible.member(x[self.layout.parameters[:, 0]])

    def moved_to(self, x: np.ndarray) -> tuple[FullProgram, np.ndarray]:
        """The program with path constraints at the worst instants of variables x, and its variables
        there."""
        p, edges, scheme = self.layout.parameters[:, 0], self.mesh.edges, self.mesh.scheme.name
        program = full_program(self.control, x[p], edges, scheme, self.far)
        for name in ("rotation", ACTUATORS):
            if name in self.groups:
                rows = self.groups[name]
                program = program.with_bounds(name, self.row_lower[rows], self.row_upper[rows])
        return program, np.concatenate([x[: self.layout.n], program.limits.bends(x[p])])

    def with_bounds(self, name: str, lower: np.ndarray, upper: np.ndarray) -> FullProgram:
        low, high = self.row_lower.copy(), self.row_upper.copy()
        low[self.groups[name]], high[self.groups[name]] = lower, upper
        return replace(self, row_lower=low, row_upper=high)

    def feasible(self, parameters: np.ndarray, delta: float) -> np.ndarray:
        """Variables ``(n,)`` that satisfy every equation but the closure of the rotation."""
        motion = balanced_variables(self.control, self.layout, self.mesh, parameters, delta)
        return np.concatenate([motion, self.limits.bends(parameters)])


def full_program(
    control: ControlProblem,
    parameters: np.ndarray,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> FullProgram:
    """The program on the first mesh, or on given edges and scheme, with path constraints at the
    worst instants of a gait and pairs of links `far` kept from crossing."""
    mesh = control.mesh(edges, scheme)
    layout, admissible, aims = layout_of(control, mesh), control.admissible, control.aims
    gaits, n_joint, fraction = admissible.gait, admissible.n_joint, admissible.gait.fraction
    turn = control.dynamics.turn
    p = layout.parameters[:, 0]
    limits = ShapeLimits(control, mesh, layout, parameters, far)
    program = Rows(layout.n + limits.n_bend)

    # the motion: link by link, or by the velocity map
    lifted = control.formulation == FULL
    motion = (_Links if lifted else _Mapped)(program, control, mesh, layout)

    # functions of a whole period
    delta = ca.SX.sym("delta")
    names = sorted({name for aim in (aims.objective, *dict(aims.at_least)) for name in aim.uses})
    parts = {name: ca.SX.sym(name, 1 + (name == "rotation")) for name in names}
    period = {name: part / fraction for name, part in parts.items()}
    for name, value in {
        "distance": lambda part: chord_per_way(turn) * part / fraction,
        "rotation": lambda part: part[0] - part[1] + turn,
        "period": ca.exp,
    }.items():
        if name in parts:
            period[name] = value(parts[name])
    values = ca.vertcat(*(aim(period) for aim in (aims.objective, *dict(aims.at_least))))
    of_period = program.repeat(
        ca.vertcat(*parts.values()), values, layout.of_period(names), delta=delta
    )
    w = ca.SX.sym("p", p.size)
    speed = program.repeat(w, _square_of_speed(gaits, w, n_joint), p[:, None], delta=delta)
    if not gaits.linear:
        given = ca.vertcat(*(a for row in gaits.coefficients(w, n_joint) for a in row))
        left = w[gaits.n_own : gaits.n_own + given.numel()] - given
        members = program.repeat(w, left, p[:, None], delta=delta)
    crossing = limits.repeat(program)
    sums = motion.totals()
    program.close()

    # rows
    pick = program.pick
    state, rate = mesh.integration()
    motion.add_rows(state, rate)
    sign = closing_sign(gaits.closing_symmetry)
    theta = pick(layout.theta[0])
    if sign is not None and aims.rotation is not None:
        program.add("rotation", theta[-1] + sign * theta[0])
    if "theta" in kind_of_motion(control.dynamics).static_parameters:
        program.add("heading", theta[0] - pick(p[-1:]))
    state, rate = mesh.quadrature()
    ahead, aside, power = motion.ways()
    program.add("distance", state @ pick(layout.distance[0]) - RADIANS * rate @ ahead)
    program.add("work", state @ pick(layout.work[0]) - RADIANS * rate @ power)
    integral = sparse.csr_matrix(rate.sum(axis=0))
    for quantity, total, gained in zip(aims.integrals, layout.totals, sums, strict=True):
        program.add(quantity.name, pick(total) - RADIANS * integral @ pick(gained))
    if aims.no_way_across:
        program.add("across", integral @ aside)
    if not gaits.linear:
        program.add("members", pick(members))
    cells = limits.add_rows(program, crossing)
    program.add(SHAPE_SPEED, pick(speed), admissible.smallest_shape_speed**2, np.inf)
    if aims.at_least:
        least = np.array([value for _, value in aims.at_least])
        program.add(AT_LEAST, pick(of_period[1:]), least, np.inf)
    motion.add_limits()

    lower, upper = np.full(program.n, -np.inf), np.full(program.n, np.inf)
    lower[p], upper[p] = gaits.bounds(admissible.body, widest(admissible.joint_limit))
    if isinstance(body := control.dynamics.body, Chain) and lifted:
        most = body.contact.largest_forces(control.dynamics.law)
        lower[layout.friction], upper[layout.friction] = -most, most
    for total in (layout.distance, layout.work):
        lower[total[0, 0]] = upper[total[0, 0]] = 0.0
    return FullProgram(
        control, mesh, far, layout, program.groups, cells, lower, upper,
        np.concatenate(program.lower), np.concatenate(program.upper), tuple(program.repeated),
        sparse.vstack(program.rows).tocsr(), -pick(of_period[0]), limits, motion.velocity,
    )  # fmt: skip


class _Motion:
    """The equations of motion of a body at the points of a mesh."""

    velocity: BalancedVelocity | None = None

    def __init__(self, program: Rows, control: ControlProblem, mesh: Mesh, layout: Layout) -> None:
        self.program, self.control, self.mesh, self.layout = program, control, mesh, layout
        self.dynamics = control.dynamics.in_speeds_of(RADIANS)
        self.sites = np.empty(mesh.n_point, dtype=int)
        self.sites[mesh.points] = mesh.sites
        gait, n_joint = control.admissible.gait, control.admissible.n_joint
        # (joint, point), as index arrays are picked
        self.Phi, self.Phi_t = (
            sparse.csr_matrix(matrix.transpose(1, 0, 2).reshape(-1, matrix.shape[2]))
            for matrix in (
                gait.angle_matrix(mesh.times, n_joint),
                gait.rates_on(mesh, n_joint) / RADIANS,
            )
        )
        self.offset = np.repeat(gait.offset(n_joint)[:, 0], mesh.n_point)
        self.delta, self.relative = ca.SX.sym("delta"), gait.relative_delta
        if self.relative and self.dynamics.turn:
            self.lengths = self._lengths_of_sides()
        self.functions()

    def functions(self) -> None:
        raise NotImplementedError

    def of_points(self, size: int) -> sparse.csr_matrix:
        return self.spread(np.ones((1, size)))

    def spread(self, matrix: np.ndarray) -> sparse.csr_matrix:
        return sparse.csr_matrix(sparse.kron(matrix, sparse.eye(self.mesh.n_point)))

    def at_points(self, formulas: Sequence[Any]) -> np.ndarray:
        """Values of formulas at every point, ``(n_value, n_point)``."""
        body, law = self.dynamics.body, self.dynamics.law
        local, gather, q, r, moment = self.joints(any(each.needs_forces for each in formulas))
        slow = self.delta * ca.norm_2(r) if self.relative else self.delta
        now = Instants(
            body, law, q, r, slow, unit=RADIANS, moments=moment,
            joint_map=self.dynamics.joint_map,
        )  # fmt: skip
        out = ca.vertcat(*(each.at(now) for each in formulas))
        return self.program.repeat(local, out, gather, delta=self.delta)

    def joints(self, with_moments: bool) -> tuple[ca.SX, np.ndarray, ca.SX, ca.SX, ca.SX | None]:
        """Local variables of a point, and angles, rates and moments of them."""
        raise NotImplementedError

    def totals(self) -> list[np.ndarray]:
        """Densities of integrals, and shares of actuator limits, at the points."""
        actuators = self.control.actuators
        self.limited = self.at_points([actuators]) if actuators.names else None
        return [self.at_points([quantity]) for quantity in self.control.aims.integrals]

    def add_limits(self) -> None:
        if self.limited is not None:
            least = np.tile(self.control.actuators.least, self.mesh.n_point)
            self.program.add(
                ACTUATORS, self.program.pick(self.limited.ravel(order="F")), least, 1.0
            )

    def add_orientation(self, spin: np.ndarray, state: Any, rate: Any) -> None:
        """theta' = w_0, less the turning of the axes."""
        pick, theta = self.program.pick, self.layout.theta[0]
        rows = state @ pick(theta) - RADIANS * rate @ pick(spin)
        if self.relative and self.dynamics.turn:  # the axes turn evenly along the path
            gait, mesh = self.control.admissible.gait, self.mesh
            corners = gait.corners_in_time
            side = np.searchsorted(corners, mesh.edges[:-1], side="right") - 1
            side = np.repeat(side, mesh.scheme.s)
            share = sparse.diags(self.dynamics.turn * corners[-1] / np.diff(corners)[side])
            rows = rows + rate @ share @ pick(self.lengths[side])
            self.program.add("orientation", rows)
            return
        even = -self.dynamics.turn * np.asarray(rate.sum(axis=1)).ravel()
        self.program.add("orientation", rows, even, even)

    def _lengths_of_sides(self) -> np.ndarray:
        """Length of every side of a polygon over that of all, ``(n_side, 1)``."""
        gait, p = self.control.admissible.gait, self.layout.parameters
        shares, rates = gait.side_rates(self.control.admissible.n_joint)
        w = ca.SX.sym("p", p.size)
        sides = zip(shares, rates, strict=True)
        lengths = ca.vertcat(*(share * ca.norm_2(ca.DM(each) @ w) for share, each in sides))
        return self.program.repeat(w, lengths / ca.sum1(lengths), p, delta=self.delta)


def _square_of_speed(gaits: AnyClass, p: ca.SX, n_joint: int) -> ca.SX:
    """Square of the root-mean-square shape speed, or of the mean one where the pace does not
    matter."""
    if not gaits.relative_delta:
        return ca.bilin(ca.DM(gaits.mean_square_rate(n_joint) / RADIANS**2), p, p)
    shares, rates = gaits.side_rates(n_joint)
    sides = zip(shares, rates / RADIANS, strict=True)
    return sum(share * ca.norm_2(ca.DM(each) @ p) for share, each in sides) ** 2


class _Links(_Motion):
    """A chain, link by link."""

    def functions(self) -> None:
        self.chain = cast(Chain, self.dynamics.body)
        inertial = bool(self.layout.momenta.size)
        self.halves = self._halves(inertial)
        if self.relative:
            w = ca.SX.sym("w", self.chain.n_link)
            self.speed = self.program.repeat(
                w, ca.norm_2(ca.diff(w)), self.layout.spins, delta=self.delta
            )
        self.contacts = [(group.rows, self._contact(group, inertial)) for group in self._groups()]
        self.load = self._load()
        joint = np.arange(self.chain.n_joint)
        if inertial:
            self.swing, self.change = self._swing(), self._change()
        else:
            self.levers = [self._lever(joint, joint + side) for side in (0, 1)]

    def _groups(self) -> list[Any]:
        return self.chain.contact.groups(self.dynamics.law)

    def _instances(self, rows: Sequence[np.ndarray], parts: Any) -> np.ndarray:
        """Local variables, ``(n_local, n_part * n_point)``, part by part."""
        return np.stack([row[parts].ravel() for row in rows])

    def _part_numbers(self, **columns: np.ndarray) -> tuple[list[Any], ca.SX, np.ndarray]:
        shared, symbols, values = [], [], []
        for name, column in columns.items():
            column = np.ravel(column)
            if np.ptp(column) == 0.0:
                shared.append(float(column[0]))
                continue
            symbols.append(ca.SX.sym(name))
            shared.append(symbols[-1])
            values.append(np.repeat(column, self.mesh.n_point))
        size = self.mesh.n_point * np.size(next(iter(columns.values())))
        return shared, ca.vertcat(ca.SX(0, 1), *symbols), np.reshape(values, (len(values), size))

    def _halves(self, inertial: bool) -> np.ndarray:
        """l/2 w sin phi, l/2 w cos phi; with inertia l/2 cos phi, l/2 sin phi, too."""
        local = ca.SX.sym("link", 2)
        (length,), given, values = self._part_numbers(length=self.chain.length_column())
        phi, w = ca.vertsplit(local)
        half = 0.5 * length * ca.vertcat(ca.sin(phi), ca.cos(phi))
        out = ca.vertcat(half * w, half[[1, 0]]) if inertial else half * w
        gather = self._instances([self.layout.directions, self.layout.spins], slice(None))
        return self.program.repeat(local, out, gather, given, values, delta=self.delta)

    def _contact(self, group: Any, inertial: bool) -> np.ndarray:
        """Force in the plane, moment and power of parts under one law."""
        layout, contact = self.layout, self.chain.contact
        law, rows, links = group.law, group.rows, np.array(contact.links)[group.rows]
        (along, offset, cos, sin, length, pressure), given, values = self._part_numbers(
            along=contact.along[rows],
            offset=contact.offset[rows],
            cos=contact.cos[rows],
            sin=contact.sin[rows],
            length=contact.length[rows],
            pressure=contact.pressure[rows],
        )
        n_part, places = len(contact.parts), [layout.friction[rows]]
        places.append(layout.friction[[n_part + row for row in rows]])
        if group.pads:
            places.append(layout.friction[contact.couples(rows)])
        moving = [layout.directions, layout.spins, layout.vx, layout.vy]
        moving += [layout.x, layout.y] if inertial else []
        if self.relative:
            places.append(np.repeat(layout.speed, len(links), axis=0))
        gather = np.concatenate(
            [self._instances(moving, links), np.stack([part.ravel() for part in places])]
        )
        local = ca.SX.sym("contact", gather.shape[0])
        slow = self.delta * local[-1] if self.relative else self.delta
        (phi, w, vx, vy), force = ca.vertsplit(local)[:4], ca.vertsplit(local)[len(moving) :]
        c, s = ca.cos(phi), ca.sin(phi)
        us, un = vx * c + vy * s - offset * w, vy * c - vx * s + along * w
        vs, vn = cos * us + sin * un, cos * un - sin * us
        if group.pads:
            pressed = LinkForce(*(each / pressure for each in force[:3]))
            laws = line_integrals(law).scaled_laws(vs, vn, w, length, slow, pressed)
        else:
            density = law.density(vs, vn, slow)
            secant = law.density_secant(vs, vn, slow)
            laws = [(force[k] / pressure - density[k]) / secant[k][k] for k in range(2)]
        couple = force[2] if group.pads else 0.0
        fs, fn = cos * force[0] - sin * force[1], sin * force[0] + cos * force[1]
        fx, fy = c * fs - s * fn, s * fs + c * fn
        moment = along * fn - offset * fs + couple
        if inertial:
            x, y = ca.vertsplit(local)[4:6]
            moment += x * fy - y * fx
        power = -(force[0] * vs + force[1] * vn + couple * w)
        out = ca.vertcat(fx, fy, moment, power, *laws)
        return self.program.repeat(local, out, gather, given, values, delta=self.delta)

    def _load(self) -> np.ndarray | None:
        """m g in the plane of every link, and its power."""
        layout, local = self.layout, ca.SX.sym("link", 3)
        pull = self.dynamics.regime.pull(local[0])
        if pull is None:
            return None
        (mass,), given, values = self._part_numbers(mass=self.chain.mass_column())
        c, s = ca.cos(local[0]), ca.sin(local[0])
        force = mass * ca.vertcat(c * pull[0] - s * pull[1], s * pull[0] + c * pull[1])
        tail = np.repeat(layout.directions[:1], self.chain.n_link, axis=0)
        gather = self._instances([tail, layout.vx, layout.vy], slice(None))
        out = ca.vertcat(force, ca.dot(force, local[1:]))
        return self.program.repeat(local, out, gather, given, values, delta=self.delta)

    def _lever(self, joint: np.ndarray, link: np.ndarray) -> np.ndarray:
        """l/2 e x N of the forces at joints on one of their links."""
        layout, local = self.layout, ca.SX.sym("joint", 3)
        lengths = self.chain.length_column()[link]
        (length,), given, values = self._part_numbers(length=lengths)
        phi, nx, ny = ca.vertsplit(local)
        gather = np.concatenate(
            [
                self._instances([layout.directions], link),
                self._instances([layout.joint_fx, layout.joint_fy], joint),
            ]
        )
        out = 0.5 * length * (ca.cos(phi) * ny - ca.sin(phi) * nx)
        return self.program.repeat(local, out, gather, given, values, delta=self.delta)

    def _swing(self) -> np.ndarray:
        """J w + m x cross v of every link."""
        layout, local = self.layout, ca.SX.sym("link", 5)
        (mass, inertia), given, values = self._part_numbers(
            mass=self.chain.mass_column(),
            inertia=self.chain.inertia_column(),
        )
        w, vx, vy, x, y = ca.vertsplit(local)
        rows = [layout.spins, layout.vx, layout.vy, layout.x, layout.y]
        gather, out = self._instances(rows, slice(None)), inertia * w + mass * (x * vy - y * vx)
        return self.program.repeat(local, out, gather, given, values, delta=self.delta)

    def _change(self) -> np.ndarray:
        """Velocity of the centre of mass in tail axes, and the rates of the momenta."""
        layout, (free, paces) = self.layout, self._paces()
        gather = np.concatenate(
            [
                layout.directions[:1],
                layout.spins[:1],
                layout.centre,
                layout.momenta[:, self.sites],
                paces,
            ]
        )
        local = ca.SX.sym("point", gather.shape[0])
        phi, w, vx, vy, fx, fy, moment = ca.vertsplit(local)[:7]
        momenta = local[7 : 7 + len(STATES)]
        c, s = ca.cos(phi), ca.sin(phi)
        pushed = ca.vertcat(c * fx + s * fy, c * fy - s * fx, moment) / self._froude(local, free)
        changes = pushed + turning(ca.vertcat(0, 0, w), momenta)
        out = ca.vertcat(c * vx + s * vy, c * vy - s * vx, changes)
        return self.program.repeat(local, out, gather, delta=self.delta)

    def joints(self, with_moments: bool) -> tuple[ca.SX, np.ndarray, ca.SX, ca.SX, ca.SX | None]:
        layout, n = self.layout, self.chain.n_joint
        rows = [layout.directions, layout.spins]
        inertial = with_moments and bool(layout.momenta.size)
        if inertial:
            free, paces = self._paces()
            rows += [layout.accelerations, layout.momenta[:, self.sites], paces]
        elif with_moments:
            rows.append(layout.moments)
        gather = np.concatenate(rows)
        local = ca.SX.sym("point", gather.shape[0])
        phi, w, rest = local[: n + 1], local[n + 1 : 2 * n + 2], local[2 * n + 2 :]
        q, r = ca.diff(phi), ca.diff(w)
        if not inertial:
            return local, gather, q, r, rest if with_moments else None
        momenta = rest[n : n + len(STATES)]
        torques = torque_function(self.chain, self.dynamics.law)
        moment = torques(q, r, rest[:n], momenta, self.delta, self._froude(local, free))
        return local, gather, q, r, moment

    def _paces(self) -> tuple[bool, np.ndarray]:
        free = [self.layout.pace] if self.dynamics.regime.free_pace else []
        paces = np.repeat(self.layout.parameters[free], self.mesh.n_point, axis=1)
        return bool(free), paces.reshape(len(free), self.mesh.n_point)

    def _froude(self, local: ca.SX, free: bool) -> Any:
        """Froude number for time in radians; a free log period is the last local variable."""
        return (ca.exp(-2.0 * local[-1]) if free else self.dynamics.regime.froude) * RADIANS**2

    def _on_links(self, output: int) -> sparse.csr_matrix:
        """Sum over the contacts of each link."""
        n_link = self.chain.n_link
        links, total = np.array(self.chain.contact.links), 0
        for rows, outputs in self.contacts:
            to_links = 1.0 * (links[rows] == np.arange(n_link)[:, None])
            total = total + self.spread(to_links) @ self.program.pick(outputs[output])
        return total

    def add_rows(self, state: Any, rate: Any) -> None:
        program, layout, pick = self.program, self.layout, self.program.pick
        n_link = self.chain.n_link
        p, theta = pick(layout.parameters), pick(layout.theta[0, self.sites])
        phi, w, vx, vy = map(pick, (layout.directions, layout.spins, layout.vx, layout.vy))
        diff = np.diff(np.eye(n_link), axis=0)
        d, both = self.spread(diff), self.spread(np.abs(diff))  # of neighbours, at their joint
        # outputs are ordered instance by instance, instances part by part
        sin, cos = (pick(row) for row in self.halves[:2])
        program.add("tail", phi[: self.mesh.n_point] - theta)
        program.add("angles", d @ phi - self.Phi @ p, self.offset, self.offset)
        program.add("rates", d @ w - self.Phi_t @ p)
        if self.relative:
            program.add("speed", pick(layout.speed) - pick(self.speed))
        program.add("velocity x", d @ vx + both @ sin)
        program.add("velocity y", d @ vy - both @ cos)
        for k, (_, outputs) in enumerate(self.contacts):
            program.add(f"force law {k + 1}", pick(outputs[4:]))
        loads = [self._on_links(k) for k in range(2)]
        if self.load is not None:
            loads = [force + pick(self.load[k]) for k, force in enumerate(loads)]
        moment = self._on_links(2)
        if layout.momenta.size:
            self._add_momenta(loads, moment, state, rate)
        else:
            up = self.spread(diff.T)
            program.add("force x", up @ pick(layout.joint_fx) + loads[0])
            program.add("force y", up @ pick(layout.joint_fy) + loads[1])
            lever = sum(
                self.spread(np.eye(n_link)[:, side : n_link - 1 + side]) @ pick(self.levers[side])
                for side in (0, 1)
            )
            program.add("torque", up @ pick(layout.moments) + moment - lever)
        self.add_orientation(layout.spins[0], state, rate)

    def _add_momenta(
        self, loads: list[sparse.csr_matrix], moment: sparse.csr_matrix, state: Any, rate: Any
    ) -> None:
        program, layout, pick = self.program, self.layout, self.program.pick
        n_link = self.chain.n_link
        mass, every = self.spread(self.chain.mass_column().T), self.of_points(n_link)
        diff = np.diff(np.eye(n_link), axis=0)
        d, both = self.spread(diff), self.spread(np.abs(diff))
        for axis, place, half in (("x", layout.x, 2), ("y", layout.y, 3)):
            program.add(f"place {axis}", d @ pick(place) - both @ pick(self.halves[half]))
            program.add(f"centre {axis}", mass @ pick(place))
        sums = [mass @ pick(layout.vx), mass @ pick(layout.vy)]
        sums += [every @ load for load in (*loads, moment)]
        for name, row, total in zip(
            ("speed x", "speed y", "force x", "force y", "torque"), layout.centre, sums, strict=True
        ):
            program.add(name, pick(row) - total)
        now = [pick(self.change[0]), pick(self.change[1]), every @ pick(self.swing)]
        for k, name in enumerate(STATES):
            sites = pick(layout.momenta[k])
            program.add(f"{name} of the body", now[k] - sites[self.sites])
            program.add(
                f"momentum {name}", state @ sites - RADIANS * rate @ pick(self.change[2 + k])
            )
        if layout.accelerations.size:
            matrix = self.control.admissible.gait.angle_matrix(
                self.mesh.times, self.chain.n_joint, 2
            )
            rows = matrix.transpose(1, 0, 2).reshape(-1, matrix.shape[2]) / RADIANS**2
            p = pick(layout.parameters)
            program.add("accelerations", pick(layout.accelerations) - sparse.csr_matrix(rows) @ p)
        image = momenta_image(self.dynamics.symmetry)
        begin, end = pick(layout.momenta[:, 0]), pick(layout.momenta[:, -1])
        program.add("momenta", end - (begin if image is None else sparse.csr_matrix(image) @ begin))

    def ways(self) -> tuple[Any, Any, Any]:
        pick, layout = self.program.pick, self.layout
        mass, angle = self.spread(self.chain.mass_column().T), self.dynamics.regime.ahead
        vx, vy = mass @ pick(layout.vx), mass @ pick(layout.vy)
        c, s = np.cos(angle), np.sin(angle)
        power = self._on_links(3)
        if self.load is not None:  # of the joints
            power = power - pick(self.load[2])
        return c * vx + s * vy, c * vy - s * vx, self.of_points(self.chain.n_link) @ power


class _Mapped(_Motion):
    """A body whose tail velocity is tied to the one that balances it."""

    def functions(self) -> None:
        layout, body, law = self.layout, self.dynamics.body, self.dynamics.law
        self.velocity = BalancedVelocity(body, law, self.mesh.n_point)
        gather = np.concatenate(
            [layout.theta[:, self.sites], layout.angles, layout.rates, layout.z]
        )
        values, solve = np.empty((0, self.mesh.n_point)), self.velocity.of_local
        solve = partial(solve, relative=self.relative)
        point = Repeated(velocity_map(body, law, relative=self.relative), gather, values, solve)
        self.point = self.program.add_repeated(point)

    def joints(self, with_moments: bool) -> tuple[ca.SX, np.ndarray, ca.SX, ca.SX, ca.SX | None]:
        n = self.dynamics.body.n_joint
        local = ca.SX.sym("point", 2 * n)
        gather = np.concatenate([self.layout.angles, self.layout.rates])
        return local, gather, local[:n], local[n:], None

    def add_rows(self, state: Any, rate: Any) -> None:
        program, layout, pick = self.program, self.layout, self.program.pick
        p = pick(layout.parameters)
        program.add("angles", pick(layout.angles) - self.Phi @ p, self.offset, self.offset)
        program.add("rates", pick(layout.rates) - self.Phi_t @ p)
        program.add("balance", pick(self.point[:3]))
        self.add_orientation(layout.z[2], state, rate)

    def ways(self) -> tuple[Any, Any, Any]:
        return tuple(self.program.pick(self.point[k]) for k in (3, 4, 5))
