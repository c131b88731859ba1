"""What this machine's processor must have for the extension module."""
import os
import platform
import sys
import warnings


def processor_flags(text=None):
    """The flags of the first processor that /proc/cpuinfo tells of; none where it is not there."""
    if text is None:
        try:
            with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
                text = file.read()
        except OSError:
            return set()
    for line in text.splitlines():
        if line.startswith("flags"):
            return set(line.split(":", 1)[1].split())
    return set()


def check_processor(machine, flags):
    """Raises ImportError where the wheel's code cannot run; returns a warning, or '', where it runs slowly."""
    if machine not in ("x86_64", "AMD64"):
        return ""
    if flags and "sse2" not in flags:
        raise ImportError("graupel needs an x86-64 processor with SSE2, which this one does not report. Use another "
                          "machine")
    if flags and not {"avx2", "fma"} <= flags:
        return ("this processor has no AVX2: graupel runs with SSE2, several times slower than with AVX2. Results "
                "differ from those of other processors in rounding alone")
    return ""


def load_module():
    """Imports graupel._graupel; says what is missing where it does not load."""
    warning = check_processor(platform.machine(), processor_flags())
    if warning:
        warnings.warn(warning, RuntimeWarning, stacklevel=3)
    # Waiting OpenMP threads sleep soon: libgomp's default, seconds of spinning, stalls a busy machine. It is read once.
    limits_spinning = "GOMP_SPINCOUNT" not in os.environ and "OMP_WAIT_POLICY" not in os.environ
    if limits_spinning:
        os.environ["GOMP_SPINCOUNT"] = "20000"
    try:
        from . import _graupel
    except ImportError as error:
        place = os.path.dirname(__file__)
        built = [name for name in os.listdir(place) if name.startswith("_graupel.") and name.endswith(".so")]
        if not built:
            raise ImportError(f"graupel's extension module is not built in {place}. Install the wheel that "
                              "'pip wheel .' makes, and do not import graupel from its sources") from error
        raise ImportError(f"graupel's extension module ({built[0]}) does not load in Python "
                          f"{sys.version_info.major}.{sys.version_info.minor}: {error}") from error
    finally:
        if limits_spinning:
            del os.environ["GOMP_SPINCOUNT"]
    return _graupel
