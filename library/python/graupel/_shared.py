"""Models and scenes that come with the package."""
from pathlib import Path

from ._errors import InputError

FOLDER = Path(__file__).parent / "share" / "graupel"


def _path(folder, name, ending):
    file = FOLDER / folder / (name if name.endswith(ending) else name + ending)
    if not file.is_file():
        known = sorted(str(found.relative_to(FOLDER / folder))[:-len(ending)]
                       for found in (FOLDER / folder).rglob("*" + ending))
        raise InputError(f"the package has no '{name}' among its {folder} (there are: {', '.join(known)}). Choose one "
                         "of these, or give a file's path to the function itself")
    return file


def model_path(name: str) -> Path:
    """The weights file of a shipped model: 'hgn', 'hgn-general', 'gns', 'nsf-jelly', ... Raises InputError."""
    return _path("models", name, ".safetensors")


def scene_path(name: str) -> Path:
    """A shipped scene or recipe: 'shared/water_steps', 'recipes/hgn', ... Raises InputError."""
    return _path("scenes", name, ".json")
