"""First scene: a block of jelly falls on a ball. Run it: python 1_first_scene.py

A scene says what is there at the start, in SI units with y up. The builder collects it and checks it at the end.
"""
import graupel

scene = (graupel.SceneBuilder(size=(0.8, 0.8, 0.8), dx=0.025)
         .material("jelly", preset="jelly")
         .source("jelly", "box", size=(0.2, 0.2, 0.2), position=(0.42, 0.5, 0.4))
         .obstacle("sphere", radius=0.1, position=(0.4, 0.18, 0.4), friction=0.3)
         .scene(frames=30))

# A run has the particles of the scene. Arrays are NumPy's, read-only, without a copy; each is the state of its moment.
run = graupel.Simulation(scene)
start = run.positions
print(f"{run.particle_count} particles, {run.balance()['mass']:.2f} kg, centre {start.mean(axis=0)} m")

# Frames are 1/60 s here (scene.frame_time). The solver takes as many substeps as it needs.
run.run(progress=lambda frame: frame % 10 == 0 and print(f"frame {frame}: height {run.positions[:, 1].mean():.3f} m"))
print(f"{run.substeps} substeps in {run.time:.2f} s of the scene's time")

# What the particles feel: the Kirchhoff stress, and how much the jelly is squeezed.
stress, F = run.field("stress"), run.field("deformation_gradient")
print(f"largest pressure {-(stress[:, [0, 3, 5]].sum(axis=1) / 3).min():.0f} Pa, "
      f"largest stretch {abs(F).max():.2f}")

# The same into a file that ParaView, h5py and the other verbs read.
trajectory = graupel.simulate(scene, "jelly.h5", 5)
assert (trajectory.positions[0] == start).all() and len(trajectory) == 6
assert run.positions[:, 1].mean() < start[:, 1].mean() - 0.1
