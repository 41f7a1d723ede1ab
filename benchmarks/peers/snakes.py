"""Snakes in simulators of other people, which are run here: ``pip install pyelastica==1.0.0
kinematic-snake==1.0.0``. Both are models of X. Zhang et al., Nature Communications 12 (2021).
Lengths are in body lengths, nodes are ``(2, ELEMENTS + 1, n_time)``, tail first.
"""

from __future__ import annotations

from contextlib import redirect_stdout
from typing import Any

import numpy as np
import scipy.integrate

from colloc import Chain, Fourier

LENGTH, PERIOD, FROUDE, GRAVITY = 0.35, 2.0, 0.1, 9.80665
FORWARD, BACKWARD, SIDEWAYS = 1.0, 1.5, 2.0
MUSCLES = np.array([3.4e-3, 3.3e-3, 4.2e-3, 2.6e-3, 3.6e-3, 3.5e-3])
"""Torques [N m] at the knots of a spline, of a wave as long as the body: the optimum by CMA-ES that
PyElastica's example states."""
ELEMENTS, PER_PERIOD, AMPLITUDE = 50, 200, 7.0


def elastica_nodes(
    gait: Any = None, periods: int = 8, modulus: float = 1e6, dt: float = 1e-4
) -> np.ndarray:
    """PyElastica's continuum snake (its ContinuumSnakeCase) from rest: a rod of some modulus [Pa],
    bent by `MUSCLES`, or straight only in the bend of a gait of one harmonic; steps in s."""
    import elastica as ea

    class Snake(ea.BaseSystemCollection, ea.Forcing, ea.Damping, ea.Contact):
        pass

    class Bend(ea.NoForces):
        def apply_torques(self, system: Any, time: float = 0.0) -> None:
            phase = 2 * np.pi * time / PERIOD
            angles = gait.cos[:, 0] * np.cos(phase) + gait.sin[:, 0] * np.sin(phase)
            system.rest_kappa[0] = min(1.0, time / PERIOD) * angles * ELEMENTS / LENGTH

    radius, up, snake = 0.011 * LENGTH, np.array([0.0, 1.0, 0.0]), Snake()
    rod = ea.CosseratRod.straight_rod(
        ELEMENTS, np.zeros(3), np.array([0.0, 0.0, 1.0]), up, LENGTH, radius, 1000,
        youngs_modulus=modulus, shear_modulus=modulus / 1.5,
    )  # fmt: skip
    floor = ea.Plane(plane_origin=-radius * up, plane_normal=up)
    snake.append(rod)
    snake.append(floor)
    snake.add_forcing_to(rod).using(ea.GravityForces, acc_gravity=-GRAVITY * up)
    muscles = {
        "base_length": LENGTH, "b_coeff": MUSCLES, "period": PERIOD, "wave_number": 2 * np.pi,
        "phase_shift": 0.0, "rest_lengths": rod.rest_lengths, "ramp_up_time": PERIOD,
        "direction": up, "with_spline": True,
    }  # fmt: skip
    bent: Any = (Bend, {}) if gait is not None else (ea.MuscleTorques, muscles)
    snake.add_forcing_to(rod).using(bent[0], **bent[1])
    mu = LENGTH / (PERIOD**2 * GRAVITY * FROUDE) * np.array([FORWARD, BACKWARD, SIDEWAYS])
    snake.detect_contact_between(rod, floor).using(
        ea.RodPlaneContactWithAnisotropicFriction, k=1.0, nu=1e-6, slip_velocity_tol=1e-8,
        static_mu_array=np.zeros(3), kinetic_mu_array=mu,
    )  # fmt: skip
    snake.dampen(rod).using(ea.AnalyticalLinearDamper, damping_constant=2e-3, time_step=dt)
    snake.finalize()
    stepper, time, nodes = ea.PositionVerlet(), 0.0, [rod.position_collection[[2, 0]]]
    for _ in range(periods * PER_PERIOD):
        for _ in range(round(PERIOD / PER_PERIOD / dt)):
            time = stepper.step(snake, time, dt)
        nodes.append(rod.position_collection[[2, 0]])
    return np.moveaxis(np.array(nodes), 0, 2) / LENGTH


def centre(nodes: np.ndarray) -> np.ndarray:
    """The way of the centre of mass, ``(2, n_time)``."""
    return 0.5 * (nodes[:, 1:] + nodes[:, :-1]).mean(axis=1)


def distance(nodes: np.ndarray) -> float:
    """How far it went per cycle: the mean of the last four, which differ in the third digit."""
    places = centre(nodes)[:, -1 - 4 * PER_PERIOD :: PER_PERIOD]
    return float(np.hypot(*np.diff(places, axis=1)).mean())


def shapes(nodes: np.ndarray, links: int = ELEMENTS, harmonics: int = 6) -> tuple[Chain, Fourier]:
    """The chain of so many links, and its gait, that goes through the shapes of the last period."""
    pieces = np.diff(nodes[:, :: ELEMENTS // links, -PER_PERIOD:], axis=1)
    lengths = np.hypot(*pieces).mean(axis=1)
    angles = np.diff(np.unwrap(np.arctan2(pieces[1], pieces[0]), axis=0), axis=0)
    series = np.fft.rfft(angles)[:, : harmonics + 1] / PER_PERIOD
    gait = Fourier(series[:, 0].real, 2 * series[:, 1:].real, -2 * series[:, 1:].imag)
    return Chain(tuple(lengths / lengths.sum())), gait


def film(snakes: dict[str, np.ndarray], periods: int = 3, width: int = 800) -> str:
    """An SVG in which snakes crawl at one time and scale, each in a lane along its way."""
    lanes, scale, height = "", width / 1.8, width // 3
    for k, (name, nodes) in enumerate(snakes.items()):
        shown = nodes[..., -1 - periods * PER_PERIOD :: 5]
        way = centre(shown)
        along = complex(*(way[:, -1] - way[:, 0]))
        z = np.array([1, 1j]) @ (shown - way[:, :1, None]).reshape(2, -1) * abs(along) / along
        z = (0.57 + 0.3j + z.conj().reshape(shown.shape[1:])) * scale + 1j * k * height
        frames = [" ".join(f"{p.real:.1f},{p.imag:.1f}" for p in at[::2]) for at in z.T]
        lanes += (
            f'<text x="12" y="{k * height + 24}">{name}: {distance(nodes):.3f} body lengths per cycle'
            '</text><polyline marker-end="url(#head)"><animate attributeName="points" '
            f'dur="{periods * PERIOD:g}s" repeatCount="indefinite" values="{";".join(frames)}"/>'
            "</polyline>"
        )
    grid = "".join(f"M{(0.07 + k / 10) * scale:.0f} 0V{height * len(snakes)}" for k in range(18))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height * len(snakes)}">'
        "<style>text{font:600 15px sans-serif;fill:#1d2329}polyline{fill:none;stroke:#1d2329;"
        "stroke-width:7;stroke-linecap:round;stroke-linejoin:round}</style>"
        '<marker id="head" refX="1" refY="1" markerWidth="2" markerHeight="2"><circle cx="1" cy="1" '
        'r=".8" fill="#D55E00"/></marker><rect width="100%" height="100%" fill="#fff"/>'
        f'<path d="{grid}" stroke="#e0e5e9"/>{lanes}</svg>\n'
    )


def kinematic_distance(froude: float, periods: int = 12) -> float:
    """How far the smooth snake of kinematic-snake goes in the last of some periods from rest, by
    the wave of its README, of `AMPLITUDE` per body length."""
    import sympy

    # what SciPy and NumPy had when that package was written
    scipy.integrate.trapz = np.trapezoid
    scipy.integrate.cumtrapz = scipy.integrate.cumulative_trapezoid
    scipy.integrate.simps = scipy.integrate.simpson

    class Scalars(np.ndarray):
        """Items may be set to arrays of one number."""

        def __setitem__(self, key: Any, value: Any) -> None:
            super().__setitem__(key, np.squeeze(value))

    from kinematic_snake import KinematicSnake

    with redirect_stdout(None):
        snake = KinematicSnake(
            froude_number=froude,
            friction_coefficients={"mu_f": FORWARD, "mu_b": BACKWARD, "mu_lat": SIDEWAYS},
            activation=lambda s, t: AMPLITUDE * sympy.cos(2 * sympy.pi * (s + t)),
        )
    ran = scipy.integrate.solve_ivp(
        lambda t, state: np.asarray(snake(t, state.view(Scalars))),
        (0, periods),
        np.zeros(6),
        t_eval=(periods - 1, periods),
        rtol=1e-4,
        atol=1e-6,
    )
    return float(np.hypot(*np.diff(ran.y[:2])[:, 0]))
