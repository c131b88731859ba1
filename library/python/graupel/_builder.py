"""Scenes piece by piece."""
from __future__ import annotations

from copy import deepcopy

from ._graupel import Scene


class SceneBuilder:
    """Collects the keys of a scene file; scene() checks them all.

        scene = (graupel.SceneBuilder(size=(1, 1, 1), dx=0.02)
                 .material("water", preset="water")
                 .source("water", "box", size=(0.2, 0.3, 0.2), position=(0.3, 0.4, 0.5))
                 .obstacle("sphere", radius=0.1, position=(0.6, 0.2, 0.5), friction=0.2)
                 .scene(frames=120))

    Further keyword arguments are keys of docs/reference/scene_format.md, SI units.
    """

    def __init__(self, size=(1.0, 1.0, 1.0), dx: float = 1 / 64, **domain):
        """size: edges of the domain [m]; dx: grid spacing [m]; other keys of 'domain'."""
        self._keys: dict = {"domain": {"size": list(size), "dx": dx, **domain}, "materials": {}, "sources": [],
                            "obstacles": []}

    def material(self, name: str, **keys) -> SceneBuilder:
        """preset='water', or model= with its constants."""
        self._keys["materials"][name] = keys
        return self

    def source(self, material: str, shape: str, **keys) -> SceneBuilder:
        """A body of material at the start: position [m], velocity [m/s], size, radius, height, file ..."""
        self._keys["sources"].append({"material": material, "shape": shape, **keys})
        return self

    def obstacle(self, shape: str, **keys) -> SceneBuilder:
        """A rigid obstacle: position [m], contact, friction, motion, size, radius, height, file ..."""
        self._keys["obstacles"].append({"shape": shape, **keys})
        return self

    def emitter(self, material: str, shape: str, **keys) -> SceneBuilder:
        """A body that sends out material during the run."""
        self._keys.setdefault("emitters", []).append({"material": material, "shape": shape, **keys})
        return self

    def set(self, **keys) -> SceneBuilder:
        """Any other key: gravity=(0, -9.8, 0), frames=120, time_step={...}, transfer={...}."""
        self._keys.update(keys)
        return self

    def to_dict(self) -> dict:
        """A copy of the keys so far."""
        return deepcopy(self._keys)

    def scene(self, folder=".", **keys) -> Scene:
        """The checked scene, with more keys as in set(). Relative paths start at folder. Raises ConfigError."""
        return Scene.from_dict({**self._keys, **keys}, folder)
