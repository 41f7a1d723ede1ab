"""Follow concertina crawlers to small epsilon, delta falling along:
python -m scripts.continue_epsilon [problem file]."""

import runpy
import sys

from scripts.models.epsilon_study import Crawler, delta_for, epsilon_point, fitted_orders, table

if __name__ == "__main__":
    study = runpy.run_path(sys.argv[1] if len(sys.argv) > 1 else "problems/concertina.py")
    for crawler in map(Crawler.of, study.get("PROBLEMS", (study["PROBLEM"],))):
        points = [
            epsilon_point(crawler.with_(epsilon=e, delta=delta_for(e))) for e in study["EPSILONS"]
        ]
        small = [p for p in points if p.epsilon <= 0.02]
        orders = ", ".join(
            f"{name} {order:.3f}" for name, order in fitted_orders(small, crawler.bound).items()
        )
        print(f"\n{crawler.name}: {crawler.friction}, bound {crawler.bound:g}\n{table(points)}")
        print(f"orders (epsilon <= 0.02): {orders}")
