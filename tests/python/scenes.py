"""Small scenes of the tests."""
import graupel


def block(preset="jelly", frames=4, **keys):
    """A spinning block in the middle of a box, 40 equal substeps a frame."""
    builder = graupel.SceneBuilder(size=(0.48, 0.48, 0.48), dx=0.02)
    builder.material("matter", preset=preset)
    builder.source("matter", "box", size=(0.16, 0.08, 0.08), position=(0.24, 0.24, 0.24),
                   sampling="jittered_lattice", angular_velocity=(0, 0, 6))
    return builder.scene(name="block", frames=frames, time_step={"policy": "fixed", "substeps_per_frame": 40}, **keys)


def large():
    """Half a million particles of water: a frame takes seconds."""
    builder = graupel.SceneBuilder(size=(1, 1, 1), dx=0.0125)
    builder.material("water", preset="water")
    builder.source("water", "box", size=(0.5, 0.5, 0.5), position=(0.5, 0.4, 0.5))
    return builder.scene(frames=100, time_step={"policy": "fixed", "substeps_per_frame": 200})
