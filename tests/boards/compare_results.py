#!/usr/bin/env python3
"""compare_results.py HOST TARGET [--metres M] [--degrees D]: the largest differences between two outputs of
algorithm_results, an algorithm a line. Exit code 1 beyond the tolerance, or when the lines do not correspond."""
import argparse
import math


def read(path):
    poses = {}
    with open(path) as lines:
        for line in lines:
            name, stamp, *numbers = line.split()
            values = [float.fromhex(n) for n in numbers]
            assert len(values) == 7 and all(map(math.isfinite, values)), line
            poses.setdefault(name, []).append((int(stamp), values))
    return poses


parser = argparse.ArgumentParser()
parser.add_argument("host")
parser.add_argument("target")
parser.add_argument("--metres", type=float, default=1e-3)
parser.add_argument("--degrees", type=float, default=0.01)
arguments = parser.parse_args()
host, target = read(arguments.host), read(arguments.target)
if host.keys() != target.keys() or not host:
    raise SystemExit(f"different algorithms: {sorted(host)} and {sorted(target)}")
failed = False
for name in host:
    if [s for s, _ in host[name]] != [s for s, _ in target[name]]:
        raise SystemExit(f"{name}: different stamps")
    metres = degrees = 0.0
    for (_, a), (_, b) in zip(host[name], target[name]):
        metres = max(metres, math.dist(a[:3], b[:3]))
        degrees = max(degrees, math.degrees(2 * math.asin(min(1.0, math.dist(a[3:], b[3:]) / 2))) * 2)
    bad = metres > arguments.metres or degrees > arguments.degrees
    failed |= bad
    print(f"{name:14s} {len(host[name]):4d} poses  {metres:.3e} m  {degrees:.3e} degrees{'  TOO FAR' if bad else ''}")
raise SystemExit(failed)
