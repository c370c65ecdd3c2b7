"""A curve drawn by code: python draw_curve.py

A loop around a part: painted through picks, relaxed as a snake that ridges of curvature draw to themselves, cut by a plane
for comparison, and the shortest way between two places.
"""

import numpy as np

import planish


def main(triangles: int = 20_000) -> planish.Curve:
    mesh = planish.demo_part(triangles=triangles)
    center, radius = mesh.bounds.mean(axis=0), mesh.diagonal / 2

    # Six picks around the part at half height; each goes to the nearest place of the mesh.
    angles = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    picks = center + radius * np.column_stack([np.cos(angles), np.zeros(6), np.sin(angles)])
    stroke = mesh.paint(picks, closed=True, mode="geodesic").resampled(120)
    print("painted:", stroke)

    fair = stroke.relax(fairness=1.0, curvature=1.0, sweeps=50)
    print(f"relaxed: {fair} in {fair.facts['sweeps']} sweeps")

    bent = np.abs(mesh.curvature()["most"]).clip(0.0, 5.0)
    drawn = stroke.relax(scalar=bent, attraction=0.05, sweeps=50)
    print("drawn to ridges:", drawn)

    print("cut by a plane:", mesh.section(picks[0], normal=[0.0, 1.0, 0.0]))
    print("shortest way:", mesh.geodesic(picks[0], picks[2]))
    return fair


if __name__ == "__main__":
    main()
