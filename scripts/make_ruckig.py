#!/usr/bin/env python3
"""Makes tests/golden/ruckig.txt: durations of time-optimal, jerk-limited moves from rest to rest, computed by Ruckig (Berscheid, Kroeger,
"Jerk-limited Real-time Trajectory Generation with Arbitrary Target States", RSS 2021), as the reference for the host's closed form.

    python3 -m venv target/ruckig && target/ruckig/bin/pip install ruckig==0.19.4
    target/ruckig/bin/python scripts/make_ruckig.py

Only needed to change the table; the tests read the committed one. Lengths are mm, times s.
"""

import itertools
import pathlib
import random

from ruckig import InputParameter, Result, Ruckig, Trajectory

TABLE = pathlib.Path(__file__).resolve().parent.parent / "tests" / "golden" / "ruckig.txt"
# Distances, mm: from 0.01, where no limit but the jerk is reached, to 500, where all limits are.
DISTANCES = [0.01, 0.1, 0.5, 1, 2, 5, 10, 20, 50, 200, 500]
# Velocity, mm/s, acceleration, mm/s2, and jerk, mm/s3: common axes, low feeds, slow and stiff axes.
LIMITS = [
    (100, 1000, 20000),
    (10, 1000, 20000),
    (50, 500, 10000),
    (200, 1000, 20000),
    (1, 1000, 20000),
    (100, 100, 100000),
    (30, 4000, 8000),
    (166.7, 2500, 60000),
    (300, 5000, 500000),
]
# Number of random cases, seeded, log-uniform over the decades.
RANDOM = 120
SEED = 6


def duration(distance, velocity, acceleration, jerk):
    """Duration of one move, s. Asserts the final position and velocity."""
    wanted = InputParameter(1)
    wanted.current_position, wanted.current_velocity, wanted.current_acceleration = [0.0], [0.0], [0.0]
    wanted.target_position, wanted.target_velocity, wanted.target_acceleration = [distance], [0.0], [0.0]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [velocity], [acceleration], [jerk]
    trajectory = Trajectory(1)
    result = Ruckig(1).calculate(wanted, trajectory)
    assert result in (Result.Working, Result.Finished), result
    position, speed, _ = trajectory.at_time(trajectory.duration)
    assert abs(position[0] - distance) < 1e-8 and abs(speed[0]) < 1e-8, (distance, velocity, acceleration, jerk)
    return trajectory.duration


def main():
    """Writes the table."""
    cases = [(d, *limits) for limits, d in itertools.product(LIMITS, DISTANCES)]
    chance = random.Random(SEED)
    for _ in range(RANDOM):
        exponents = [(-2, 2.7), (0, 2.5), (1.5, 3.7), (3, 6)]
        cases.append(tuple(float(f"{10 ** chance.uniform(*ends):.4g}") for ends in exponents))
    lines = ["# scripts/make_ruckig.py: distance_mm velocity_mm_s acceleration_mm_s2 jerk_mm_s3 duration_s"]
    for case in cases:
        lines.append(" ".join(f"{value:g}" for value in case) + f" {duration(*map(float, case)):.15g}")
    TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
