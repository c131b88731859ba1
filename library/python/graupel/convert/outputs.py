"""The file of --json: checked before the work, so that it takes the place of nothing that is read or made; written aside."""
import os

from .conversion import format_of_folder, split_file
from .errors import ConfigError, OutputError, writing
from .series import SPLITS


def _same(one, other):
    """Whether both paths are one file, by whatever path or link."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def _is_special(path):
    """/dev/null, a pipe: nothing there can be lost."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def check_json_file(options):
    """Raises OutputError where the file of --json cannot be made; ConfigError where it is one of the input folder, or one
    that the output will have."""
    path = options.json
    if path in ("", "-") or _is_special(path):
        return
    if os.path.isdir(path):
        raise OutputError(f"cannot write '{path}' (it is a folder). Name a file")
    folder = os.path.dirname(os.path.abspath(path))
    if folder != os.path.abspath(options.output) and not os.path.isdir(folder):
        raise OutputError(f"cannot write '{path}' (there is no folder '{folder}'). Make it first, or name another")
    format_of_folder(options.input)  # says what is wrong with it
    for name in sorted(os.listdir(options.input)):
        read = os.path.join(options.input, name)
        if os.path.isfile(read) and _same(path, read):
            raise ConfigError(f"--json '{path}' would overwrite the input '{read}'. Give it another name")
    for name in ("", "dataset.json", "metadata.json", *(split_file(options.format, split) for split in SPLITS)):
        if _same(path, os.path.join(options.output, name)):
            raise ConfigError(f"--json '{path}' would overwrite the output '{options.output}'. Give it another name")


def write_text(path, text):
    """The whole file or none: written aside and renamed. Raises OutputError."""
    with writing(path):
        if _is_special(path):
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
            return
        aside = f"{path}.{os.getpid()}.part"
        try:
            with open(aside, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.replace(aside, path)
        except BaseException:
            if os.path.exists(aside):
                os.remove(aside)
            raise
