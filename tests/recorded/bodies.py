"""Everything that a body answers."""

import numpy as np

from colloc.mechanics.bodies import formulations


def shapes(body, count, seed, size):
    """Angles, rates and tail velocities."""
    rng = np.random.default_rng(seed)
    return (
        rng.uniform(-size, size, (body.n_joint, count)),
        rng.normal(size=(body.n_joint, count)),
        rng.normal(size=(3, count)),
    )


def form(body, size, seed=3, count=7):
    """What it says of its shapes."""
    angles, rates, z = shapes(body, count, seed, size)
    names = (
        "symmetries",
        "usual",
        "schedule",
        "panels",
        "looks_for_all_velocities",
        "limited",
        "limit_names",
        "drawn_width",
    )
    found = {name: getattr(body, name) for name in ("n_joint", "coordinate", "quantity")}
    found |= {"formulations": formulations(body), "n_force": len(body.force_names)}
    found |= {name: getattr(body, name) for name in (*names, "bending")}
    found |= {
        "describe": body.describe(),
        "hinges": [body.hinges.start, body.hinges.stop],
        "pairs": np.array(body.far_pairs),
    }
    found |= {
        "largest": body.largest_angles(angles),
        "contacts": [(c.name, *c.pair(angles), c.width) for c in body.contacts(body.far_pairs)],
    }
    found |= {
        "crossing": body.crossing_depth(angles),
        "passing": body.passing_depth(np.repeat(angles, 2, axis=1)),
    }
    return found | {
        "outline": body.outline(angles),
        "centre": body.centre(angles),
        "speeds": body.speeds(angles, rates, z),
        "wave": body.wave(0.7),
    }


def mechanics(body, law, delta, size, seed=4, count=6):
    """What it says of its motion under a law of friction."""
    angles, rates, z = shapes(body, count, seed, size)
    solved = body.solve(law, angles, rates, delta)
    found = {
        "sliding": body.sliding(law, angles, rates, z, delta),
        "solved": (solved.z, solved.converged),
        "motion": body.motion(law, angles, rates, delta, solved),
        "replayed": body.replayed(law, angles, rates, delta, None)[0],
        "slowness": body.slowness(law, angles, rates, delta, solved.z),
        "forces": body.forces(law, angles, rates, z, delta),
        "largest": body.largest_forces(law),
        "all": body.all_velocities(law, angles, rates, delta),
        "rubbing": body.rubbing(law, angles, rates, delta, z, 5),
    }
    if body.schedule == ():
        found["slopes"] = body.slopes(law, angles, rates, delta, solved)
    return found
