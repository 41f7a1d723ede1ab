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

Friction is stated as (f - friction)/(its secant), docs/collocation.md. theta and distances of gaits
that turn are seen from axes that turn evenly. *Ahead* is +x on level ground, where the first
orientation is free, so that maximising D turns the motion there. A load g is that of a slope.
With inertia the momenta P of the body take the place of N and M::

    P = (sum m_i v_i in the tail's axes, sum J_i w_i + m_i x_i x v_i)
    P' = (sum f_i + m_i g, sum c_i + x_i x f_i) / Fr + turning of the axes        collocated

with x_i the midpoints seen from the centre of mass; where torques count they follow from
q'', variables too, and the momenta (`colloc.dynamics.chain`). Other bodies, and the formulation
"implicit velocity", have shape coordinates q, rates r and tail velocity z as variables, and z =
Z(q, r), the velocity that balances them, in place of friction and balance.

Inequalities are the limits of the shape, each at the worst instant of the mesh cells in which it
may bind for a given gait; what actuators can do, at every point; and the mean shape speed. Every
row is a sparse matrix times (variables, outputs of functions of one link, contact or check that
are repeated over parts and points: `colloc.numerics.repeated`).
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.dynamics.chain import torque_function
from colloc.dynamics.collocated import closing_sign, momenta_image
from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.objective import chord_per_way
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.contact import Pairs
from colloc.mechanics.densities import Instants
from colloc.mechanics.friction import LinkForce, line_integrals
from colloc.mechanics.inertia import STATES, turning
from colloc.mechanics.law import Law
from colloc.numerics.repeated import LocalFunction, Program, Repeated
from colloc.transcription.layout import RADIANS, balanced_variables, layout_of
from colloc.transcription.shape_constraints import ShapeLimits

ACTUATORS, AT_LEAST, SHAPE_SPEED = "actuators", "at least", "shape speed"
_Shape = tuple[ca.SX, ca.SX, ca.SX | None, ca.SX | None]
"""Joint angles, rates and moments of a point."""


_TOLERANCE, _ACCEPTED = 1e-12, 1e3
"""Tolerance, and the factor on it where rounding stops the solver."""


@lru_cache(maxsize=32)
def velocity_map(body: Body, law: Law, *, relative: bool = False) -> LocalFunction:
    """Local functions of (theta, q, r, z): z - Z, velocities of the centre of mass, power at Z. The
    balance, a step function of z as delta goes to 0, does not converge as a constraint."""
    sizes = (("theta", 1), ("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1))
    theta, q, r, z, delta = (ca.SX.sym(name, size) for name, size in sizes)
    solved, slow = ca.SX.sym("Z", 3), delta * ca.norm_2(r) if relative else delta
    balanced = body.sliding(law, q, r, solved, slow)
    centre, c, s = body.sliding(law, q, r, z, slow).centre, ca.cos(theta), ca.sin(theta)
    ahead, aside = c * centre[0] - s * centre[1], s * centre[0] + c * centre[1]
    out = ca.vertcat(z - solved, ahead, aside, balanced.power)
    local = ca.vertcat(theta, q, r, z)
    return LocalFunction(local, ca.SX(0, 1), delta, out, solved, balanced.force)


class BalancedVelocity:
    """Tail velocities ``(3, n_time)`` that balance a body, of (theta, angles, rates, start) and
    delta; NaN where the balance does not converge."""

    def __init__(self, body: Body, friction: Law, *, relative: bool) -> None:
        self._body, self._friction, self._relative = body, friction, relative
        self._last, self.solves = np.empty(0), 0

    def __call__(self, local: np.ndarray, delta: float) -> np.ndarray:
        _, q, r, start = np.split(local, np.cumsum([1, self._body.n_joint, self._body.n_joint]))
        # Z grows like r and delta
        speed = np.sqrt((r * r).sum(axis=0)) if self._relative else np.ones(q.shape[1])
        r, start = r / speed, start / speed
        if not np.isfinite(local[:-3]).all():
            return np.full_like(start, np.nan)
        if np.isnan(start).any() and self._last.size:
            start = self._last
        solved = self._body.solve(
            self._friction, q, r, delta, start=np.nan_to_num(start), tolerance=_TOLERANCE
        )
        self.solves += 1
        self._last = np.where(solved.residual < _ACCEPTED * _TOLERANCE, solved.z, np.nan)
        return speed * self._last


class FullProgram(Program):
    """A nonlinear program ``min f(x), lower <= x <= upper, row_lower <= g(x) <= row_upper``;
    `groups` are the rows of a name, `cells` the mesh cells of a path constraint."""

    velocity: BalancedVelocity | None = None

    def __init__(
        self,
        control: ControlProblem,
        parameters: np.ndarray,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
    ) -> None:
        """On the first mesh, or on given edges and scheme, with path constraints at the worst
        instants of a gait and pairs of links `far` kept from crossing."""
        self.control, self.mesh, self.far = control, control.mesh(edges, scheme), far
        mesh = self.mesh
        self.layout = layout = layout_of(control, mesh)
        shape = parameters[: len(layout.parameters)]
        self.limits = limits = ShapeLimits(control, mesh, layout, shape, far)
        super().__init__(layout.n + limits.n_bend)
        self.dynamics, admissible = control.dynamics.in_speeds_of(RADIANS), control.admissible
        aims, gaits, n_joint = control.aims, admissible.gait, admissible.n_joint
        self.relative, pick, p = gaits.relative_delta, self.pick, layout.parameters
        self.sites = np.empty(mesh.n_point, dtype=int)
        self.sites[mesh.points] = mesh.sites

        # the functions that are repeated: of links or points, of the period, of the gait
        if self.relative and self.dynamics.turn:
            shares, rates = gaits.side_rates(n_joint)
            self.sides = self.repeat(partial(_lengths_of_sides, shares, rates), [p])
        (self._functions_of_links if control.formulation == FULL else self._function_of_body)()
        objectives = aims.objective, *dict(aims.at_least)
        names = sorted({name for aim in objectives for name in aim.uses})

        def period(*parts):
            totals, fraction, turn = {}, admissible.fraction, self.dynamics.turn
            for name, part in zip(names, parts, strict=True):
                if name == "rotation":
                    totals[name] = part[0] - part[1] + turn
                elif name == "period":
                    totals[name] = ca.exp(part)
                else:
                    chord = chord_per_way(turn) * part if name == "distance" else part
                    totals[name] = chord / fraction
            return ca.vertcat(*(aim(totals) for aim in objectives))

        of_period = self.repeat(period, [layout.total(name)[:, None] for name in names])
        speed = self.repeat(partial(_square_of_speed, gaits, n_joint), [p])
        if not gaits.linear:

            def deviation(w):
                given = ca.vertcat(*(a for row in gaits.coefficients(w, n_joint) for a in row))
                return w[gaits.n_wave : gaits.n_wave + given.numel()] - given

            members = self.repeat(deviation, [p])
        crossing = limits.repeat(self)
        actuators = control.actuators
        shares_used = self._at_points(actuators) if actuators.names else None
        densities = [self._at_points(quantity) for quantity in aims.integrals]

        # the gait, links, friction and balance
        matrices = gaits.angle_matrix(mesh.times, n_joint), gaits.rates_on(mesh, n_joint) / RADIANS
        angles, rates = (
            sparse.csr_matrix(matrix.transpose(1, 0, 2).reshape(-1, matrix.shape[2])) @ pick(p)
            for matrix in matrices  # (joint, point), as index arrays are picked
        )
        self._add_motion(angles, rates, np.repeat(gaits.offset(n_joint)[:, 0], mesh.n_point))

        # what grows along the mesh, and the boundary
        sign, theta = closing_sign(aims.closing), pick(layout.theta[0])
        if sign is not None and aims.rotation is not None:
            self.add("rotation", theta[-1] + sign * theta[0])
        if "theta" in self.dynamics.states:
            self.add("heading", theta[0] - pick(layout.static[-1]))
        state, rate = mesh.quadrature()
        ahead, aside, power = self._ways()
        self.add("distance", state @ pick(layout.distance) - RADIANS * rate @ ahead)
        self.add("work", state @ pick(layout.work) - RADIANS * rate @ power)
        integral = sparse.csr_matrix(rate.sum(axis=0))
        for quantity, total, density in zip(aims.integrals, layout.totals, densities, strict=True):
            self.add(quantity.name, pick(total) - RADIANS * integral @ pick(density))
        if aims.no_way_across:
            self.add("across", integral @ aside)

        # inequalities
        if not gaits.linear:
            self.add("members", pick(members))
        self.cells = limits.add_rows(self, crossing)
        self.add(SHAPE_SPEED, pick(speed), admissible.smallest_shape_speed**2, np.inf)
        if aims.at_least:
            least = np.array([value for _, value in aims.at_least])
            self.add(AT_LEAST, pick(of_period[1:]), least, np.inf)
        if shares_used is not None:
            least = np.tile(actuators.least, mesh.n_point)
            self.add(ACTUATORS, pick(shares_used.ravel(order="F")), least, 1.0)
        self.objective = -pick(of_period[0])

        self.lower, self.upper = np.full(self.n, -np.inf), np.full(self.n, np.inf)
        decisions = layout.decisions
        self.lower[decisions], self.upper[decisions] = admissible.bounds()
        if layout.friction.size:
            most = self.chain.contact.largest_forces(control.dynamics.law)
            self.lower[layout.friction], self.upper[layout.friction] = -most, most
        for total in (layout.distance, layout.work):
            self.lower[total[0, 0]] = self.upper[total[0, 0]] = 0.0

    def _functions_of_links(self) -> None:
        """Add the functions of a link, a contact or a joint. Parts come one after the other, each
        at all points."""
        chain: Any = self.dynamics.body
        self.chain, layout = chain, self.layout
        inertial, lengths = bool(layout.momenta.size), chain.length_column()
        phi, w, vx, vy = (
            part.ravel() for part in (layout.directions, layout.spins, layout.vx, layout.vy)
        )

        def half(phi, w, length):
            """l/2 w sin phi, l/2 w cos phi; with inertia l/2 cos phi, l/2 sin phi, too."""
            half = 0.5 * length * ca.vertcat(ca.sin(phi), ca.cos(phi))
            return ca.vertcat(half * w, half[[1, 0]]) if inertial else half * w

        self.halves = self.repeat(half, [phi, w], [lengths])
        if self.relative:
            self.speed = self.repeat(lambda w: ca.norm_2(ca.diff(w)), [layout.spins])
        groups = chain.contact.groups(self.dynamics.law)
        self.contacts = [(group.rows, self._contact(group)) for group in groups]

        def load(theta, vx, vy, mass):
            """m g in the plane, and its power."""
            pull: Any = self.dynamics.regime.pull(theta)
            c, s = ca.cos(theta), ca.sin(theta)
            force = mass * ca.vertcat(c * pull[0] - s * pull[1], s * pull[0] + c * pull[1])
            return ca.vertcat(force, ca.dot(force, ca.vertcat(vx, vy)))

        self.load = None
        if self.dynamics.regime.pull(ca.SX.sym("theta")) is not None:
            tail = np.tile(layout.directions[0], chain.n_link)
            self.load = self.repeat(load, [tail, vx, vy], [chain.mass_column()])

        def lever(phi, nx, ny, length):
            """l/2 e x N of the force at a joint on one of its links."""
            return 0.5 * length * (ca.cos(phi) * ny - ca.sin(phi) * nx)

        if not inertial:
            forces = layout.joint_fx.ravel(), layout.joint_fy.ravel()
            links = slice(None, -1), slice(1, None)
            self.levers = [
                self.repeat(lever, [layout.directions[k].ravel(), *forces], [lengths[k]])
                for k in links
            ]
            return

        def swing(w, vx, vy, x, y, mass, J):
            """J w + m x cross v."""
            return J * w + mass * (x * vy - y * vx)

        place = layout.x.ravel(), layout.y.ravel()
        inertia = chain.mass_column(), chain.inertia_column()
        self.swing = self.repeat(swing, [w, vx, vy, *place], inertia)

        def change(tail, centre, momenta, pace):
            """Velocity of the centre of mass in tail axes, and the rates of the momenta."""
            (phi, w), (vx, vy, fx, fy, moment) = ca.vertsplit(tail), ca.vertsplit(centre)
            c, s = ca.cos(phi), ca.sin(phi)
            pushed = ca.vertcat(c * fx + s * fy, c * fy - s * fx, moment) / self._froude(pace)
            changes = pushed + turning(ca.vertcat(0, 0, w), momenta)
            return ca.vertcat(c * vx + s * vy, c * vy - s * vx, changes)

        tail = np.stack([layout.directions[0], layout.spins[0]])
        self.change = self.repeat(change, [tail, layout.centre, *self._momenta_and_pace()])

    def _contact(self, group: Any) -> np.ndarray:
        """Force in the plane, moment and power of parts under one law."""
        layout, contact, law, rows = self.layout, self.chain.contact, group.law, group.rows
        links, n_part = np.array(contact.links)[rows], len(contact.parts)
        moving = [layout.directions, layout.spins, layout.vx, layout.vy, layout.x, layout.y]
        forces = [layout.friction[rows], layout.friction[[n_part + row for row in rows]]]
        if group.pads:
            forces.append(layout.friction[contact.couples(rows)])
        speed = np.repeat(layout.speed, len(links), axis=0)

        def function(moving, force, speed, *numbers):
            (phi, w, vx, vy, *place), force = ca.vertsplit(moving), ca.vertsplit(force)
            along, offset, cos, sin, length, pressure = numbers
            slow = self.delta * speed if self.relative else self.delta
            c, s = ca.cos(phi), ca.sin(phi)
            us, un = vx * c + vy * s - offset * w, vy * c - vx * s + along * w
            vs, vn = cos * us + sin * un, cos * un - sin * us
            if group.pads:
                pressed = LinkForce(*(each / pressure for each in force))
                laws = line_integrals(law).scaled_laws(vs, vn, w, length, slow, pressed)
            else:
                density = law.density(vs, vn, slow)
                secant = law.density_secant(vs, vn, slow)
                laws = [(force[k] / pressure - density[k]) / secant[k][k] for k in range(2)]
            couple = force[2] if group.pads else 0.0
            fs, fn = cos * force[0] - sin * force[1], sin * force[0] + cos * force[1]
            fx, fy = c * fs - s * fn, s * fs + c * fn
            moment = along * fn - offset * fs + couple
            if place:
                moment += place[0] * fy - place[1] * fx
            power = -(force[0] * vs + force[1] * vn + couple * w)
            return ca.vertcat(fx, fy, moment, power, *laws)

        instances = [
            np.stack([part[links].ravel() for part in moving if part.size]),
            np.stack([part.ravel() for part in forces]),
            speed.reshape(-1, len(links) * self.mesh.n_point),
        ]
        names = ("along", "offset", "cos", "sin", "length", "pressure")
        return self.repeat(function, instances, [getattr(contact, name)[rows] for name in names])

    def _momenta_and_pace(self) -> list[np.ndarray]:
        free = int(self.dynamics.regime.free is not None)
        paces = np.repeat(self.layout.static[:free], self.mesh.n_point, axis=1)
        return [self.layout.momenta[:, self.sites], paces]

    def _froude(self, pace: ca.SX) -> Any:
        return (ca.exp(-2.0 * pace) if pace.size1() else self.dynamics.regime.froude) * RADIANS**2

    def _function_of_body(self) -> None:
        layout, body, law = self.layout, self.dynamics.body, self.dynamics.law
        self.velocity = BalancedVelocity(body, law, relative=self.relative)
        theta = layout.theta[:, self.sites]
        gather = np.concatenate([theta, layout.angles, layout.rates, layout.z])
        values = np.empty((0, self.mesh.n_point))
        function = velocity_map(body, law, relative=self.relative)
        self.point = self.add_repeated(Repeated(function, gather, values, self.velocity))

    def _at_points(self, formula: Any) -> np.ndarray:
        variables, shape = self._shape(formula.needs_forces)

        def value(*local):
            q, r, moments, froude = shape(*local)
            slow = self.delta * ca.norm_2(r) if self.relative else self.delta
            now = self.dynamics
            how: Any = {"unit": RADIANS, "moments": moments, "joint_map": now.joint_map}
            return formula.at(Instants(now.body, now.law, q, r, slow, **how, froude=froude))

        return self.repeat(value, variables)

    def _shape(self, with_moments: bool) -> tuple[list[np.ndarray], Callable[..., _Shape]]:
        """Variables of a point, and a function from them to `_Shape`."""
        layout = self.layout
        if layout.z.size:
            return [layout.angles, layout.rates], lambda q, r: (q, r, None, None)
        links = [layout.directions, layout.spins]
        if not with_moments:
            return links, lambda phi, w: (ca.diff(phi), ca.diff(w), None, None)
        if not layout.momenta.size:
            moments = [*links, layout.moments]
            return moments, lambda phi, w, moments: (ca.diff(phi), ca.diff(w), moments, None)
        torques = torque_function(self.chain, self.dynamics.law)

        def shape(phi, w, rates, momenta, pace):
            q, r, froude = ca.diff(phi), ca.diff(w), self._froude(pace)
            return q, r, torques(q, r, rates, momenta, self.delta, froude), froude

        return [*links, layout.accelerations, *self._momenta_and_pace()], shape

    def _spread(self, matrix: np.ndarray) -> sparse.csr_matrix:
        part, of = np.nonzero(matrix)
        every, n_point = np.arange(self.mesh.n_point), self.mesh.n_point
        places = (n_point * part[:, None] + every).ravel(), (n_point * of[:, None] + every).ravel()
        values = np.repeat(matrix[part, of], n_point)
        shape = n_point * matrix.shape[0], n_point * matrix.shape[1]
        return sparse.csr_matrix((values, places), shape=shape)

    def _on_links(self, output: int) -> sparse.csr_matrix:
        links, total = np.array(self.chain.contact.links), 0
        for rows, outputs in self.contacts:
            to_links = 1.0 * (links[rows] == np.arange(self.chain.n_link)[:, None])
            total = total + self._spread(to_links) @ self.pick(outputs[output])
        return total

    def _add_motion(self, angles: Any, rates: Any, offset: np.ndarray) -> None:
        layout, pick = self.layout, self.pick
        if layout.z.size:
            self.add("angles", pick(layout.angles) - angles, offset, offset)
            self.add("rates", pick(layout.rates) - rates)
            self.add("balance", pick(self.point[:3]))
            self._add_orientation(layout.z[2])
            return
        n_link = self.chain.n_link
        phi, w, vx, vy = map(pick, (layout.directions, layout.spins, layout.vx, layout.vy))
        difference = np.diff(np.eye(n_link), axis=0)  # of the links at a joint
        d, both = self._spread(difference), self._spread(np.abs(difference))
        halves = [pick(row) for row in self.halves]
        self.add("tail", phi[: self.mesh.n_point] - pick(layout.theta[0, self.sites]))
        self.add("angles", d @ phi - angles, offset, offset)
        self.add("rates", d @ w - rates)
        if self.relative:
            self.add("speed", pick(layout.speed) - pick(self.speed))
        self.add("velocity x", d @ vx + both @ halves[0])
        self.add("velocity y", d @ vy - both @ halves[1])
        for k, (_, outputs) in enumerate(self.contacts):
            self.add(f"force law {k + 1}", pick(outputs[4:]))
        fx, fy, moment = map(self._on_links, range(3))
        if self.load is not None:
            fx, fy = fx + pick(self.load[0]), fy + pick(self.load[1])
        if layout.momenta.size:
            for axis, place, half in (("x", layout.x, 2), ("y", layout.y, 3)):
                mass = self._spread(self.chain.mass_column().T)
                self.add(f"place {axis}", d @ pick(place) - both @ halves[half])
                self.add(f"centre {axis}", mass @ pick(place))
            self._add_momenta([mass @ vx, mass @ vy], [fx, fy, moment])
        else:
            up = self._spread(difference.T)
            self.add("force x", up @ pick(layout.joint_fx) + fx)
            self.add("force y", up @ pick(layout.joint_fy) + fy)
            sides = (np.eye(n_link)[:, k : n_link - 1 + k] for k in (0, 1))
            lever = sum(
                self._spread(side) @ pick(each)
                for side, each in zip(sides, self.levers, strict=True)
            )
            self.add("torque", up @ pick(layout.moments) + moment - lever)
        self._add_orientation(layout.spins[0])

    def _add_momenta(self, velocity: list[Any], loads: list[Any]) -> None:
        layout, pick, (state, rate) = self.layout, self.pick, self.mesh.integration()
        every = self._spread(np.ones((1, self.chain.n_link)))
        names = ("speed x", "speed y", "force x", "force y", "torque")
        totals = velocity + [every @ load for load in loads]
        for name, row, total in zip(names, layout.centre, totals, strict=True):
            self.add(name, pick(row) - total)
        now = [pick(self.change[0]), pick(self.change[1]), every @ pick(self.swing)]
        for k, name in enumerate(STATES):
            sites = pick(layout.momenta[k])
            self.add(f"{name} of the body", now[k] - sites[self.sites])
            changes = RADIANS * rate @ pick(self.change[2 + k])
            self.add(f"momentum {name}", state @ sites - changes)
        if layout.accelerations.size:
            gait, n_joint = self.control.admissible.gait, self.chain.n_joint
            matrix = gait.angle_matrix(self.mesh.times, n_joint, 2).transpose(1, 0, 2)
            rows = sparse.csr_matrix(matrix.reshape(-1, matrix.shape[2]) / RADIANS**2)
            p = pick(layout.parameters)
            self.add("accelerations", pick(layout.accelerations) - rows @ p)
        image = momenta_image(self.dynamics.symmetry)
        begin, end = pick(layout.momenta[:, 0]), pick(layout.momenta[:, -1])
        self.add("momenta", end - (begin if image is None else sparse.csr_matrix(image) @ begin))

    def _add_orientation(self, spin: np.ndarray) -> None:
        """theta' = w_0, less the turning of the axes."""
        mesh, turn, (state, rate) = self.mesh, self.dynamics.turn, self.mesh.integration()
        rows = state @ self.pick(self.layout.theta) - RADIANS * rate @ self.pick(spin)
        if self.relative and turn:  # the axes turn evenly along the path
            corners = self.control.admissible.gait.pieces
            side = np.searchsorted(corners, mesh.edges[:-1], side="right") - 1
            side = np.repeat(side, mesh.scheme.s)
            share = sparse.diags(turn * corners[-1] / np.diff(corners)[side])
            self.add("orientation", rows + rate @ share @ self.pick(self.sides[side]))
            return
        even = -turn * np.asarray(rate.sum(axis=1)).ravel()
        self.add("orientation", rows, even, even)

    def _ways(self) -> tuple[Any, Any, Any]:
        if self.layout.z.size:
            return tuple(self.pick(self.point[k]) for k in (3, 4, 5))
        mass, angle = self._spread(self.chain.mass_column().T), self.dynamics.regime.ahead
        vx, vy = mass @ self.pick(self.layout.vx), mass @ self.pick(self.layout.vy)
        c, s = np.cos(angle), np.sin(angle)
        power = self._on_links(3)
        if self.load is not None:  # of the joints
            power = power - self.pick(self.load[2])
        every = self._spread(np.ones((1, self.chain.n_link)))
        return c * vx + s * vy, c * vy - s * vx, every @ power

    @property
    def delta_unit(self) -> float:
        return 1.0 if self.relative else RADIANS

    def member(self, x: np.ndarray) -> AnyGait:
        return self.control.admissible.member(x[self.layout.decisions])

    def moved_to(self, x: np.ndarray) -> tuple[FullProgram, np.ndarray]:
        """The program with path constraints at the worst instants of variables x, and its variables
        there."""
        p = x[self.layout.parameters[:, 0]]
        mesh = self.mesh
        program = FullProgram(self.control, p, mesh.edges, mesh.scheme.name, self.far)
        for name in ("rotation", ACTUATORS):
            if name in self.groups:
                rows = self.groups[name]
                program = program.with_bounds(name, self.row_lower[rows], self.row_upper[rows])
        return program, np.concatenate([x[: self.layout.n], program.limits.bends(p)])

    def with_bounds(self, name: str, lower: np.ndarray, upper: np.ndarray) -> FullProgram:
        program, rows = copy.copy(self), self.groups[name]
        program.row_lower, program.row_upper = self.row_lower.copy(), self.row_upper.copy()
        program.row_lower[rows], program.row_upper[rows] = lower, upper
        return program

    def feasible(self, parameters: np.ndarray, delta: float) -> np.ndarray:
        motion = balanced_variables(self.control, self.layout, self.mesh, parameters, delta)
        shape = parameters[: len(self.layout.parameters)]
        return np.concatenate([motion, self.limits.bends(shape)])


def _lengths_of_sides(shares: np.ndarray, rates: np.ndarray, p: ca.SX) -> ca.SX:
    sides = zip(shares, rates, strict=True)
    lengths = ca.vertcat(*(share * ca.norm_2(ca.DM(each) @ p) for share, each in sides))
    return lengths / ca.sum1(lengths)


def _square_of_speed(gaits: AnyClass, n_joint: int, p: ca.SX) -> ca.SX:
    if not gaits.relative_delta:
        return ca.bilin(ca.DM(gaits.mean_square_rate(n_joint) / RADIANS**2), p, p)
    shares, rates = gaits.side_rates(n_joint)
    sides = zip(shares, rates / RADIANS, strict=True)
    return sum(share * ca.norm_2(ca.DM(each) @ p) for share, each in sides) ** 2
