"""Estimate a custom payload that five Omnids carry: any MJCF with a body 'payload' and sites grasp1 .. graspN works.

python scenarios/five_robots.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import mocobot

ROBOTS, RADIUS_M, MASS_KG = 5, 0.9, 20.0


def ring_mjcf() -> str:
    """Return the MJCF of a thin ring with evenly spaced grasps and {1} at the first grasp."""
    angles = 2.0 * np.pi * np.arange(ROBOTS) / ROBOTS
    grasps = [RADIUS_M * np.array([np.cos(a) - 1.0, np.sin(a)]) for a in angles]
    sites = "\n".join(
        f'      <site name="grasp{i + 1}" pos="{x} {y} 0" euler="0 0 {angle}"/>'
        for i, ((x, y), angle) in enumerate(zip(grasps, angles, strict=True))
    )
    bars = "\n".join(
        f'      <geom name="bar{i + 1}" type="capsule" size="0.02" mass="0" contype="0" conaffinity="0"\n'
        f'            fromto="{a[0]} {a[1]} 0.06 {b[0]} {b[1]} 0.06"/>'
        for i, (a, b) in enumerate(zip(grasps, [*grasps[1:], grasps[0]], strict=True))
    )
    across = 0.5 * MASS_KG * RADIUS_M**2
    return f"""<mujoco model="ring">
  <compiler angle="radian"/>
  <worldbody>
    <body name="payload">
      <inertial pos="{-RADIUS_M} 0 0.06" mass="{MASS_KG}" diaginertia="{across} {across} {2 * across}"/>
{bars}
{sites}
    </body>
  </worldbody>
</mujoco>
"""


def main() -> None:
    """Simulate five robots that carry a ring, estimate it, and compare with the truth."""
    with tempfile.TemporaryDirectory() as folder:
        payload = Path(folder) / "ring.xml"
        payload.write_text(ring_mjcf(), encoding="utf-8")
        trials = [mocobot.simulate(payload, "random", vias=30), mocobot.simulate(payload, "static")]
    estimate = mocobot.estimate(trials)
    if not (estimate.grasps and estimate.mass and estimate.inertia) or estimate.p_1c is None:
        raise SystemExit(f"not determined: {', '.join(map(str, estimate.undetermined))}")
    moments, truth = estimate.inertia.principal.moments, trials[0].truth
    print(f"robots      {estimate.robots}")
    print(f"mass        {estimate.mass.mass:.4f} +- {estimate.mass.se:.4f} kg (true {MASS_KG})")
    print(f"p_1c        {np.round(estimate.p_1c, 5)} m (true {[-RADIUS_M, 0.0, 0.06]})")
    print(f"moments     {np.round(moments, 4)} kg m^2 (true {truth.principal_kgm2})")
    for j in range(2, ROBOTS + 1):
        error = estimate.grasps.p_1i[j - 1] - truth.p_1i[j - 1]
        print(f"p_1{j} error  {1e3 * np.linalg.norm(error):.3f} mm")


if __name__ == "__main__":
    main()
