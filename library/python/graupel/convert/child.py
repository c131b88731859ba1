"""A conversion in a process of its own: HDF5 crashes the process in which a full disk keeps a file from closing.

Lines of JSON go both ways. To the child: the request, then a line after each progress, on which it goes on; the end of
its input stops it. From the child: {"progress": [done, total]}, at last {"result": ...} or {"error": [code, text]}.
"""
import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import traceback

from .errors import ConfigError, ConvertError, Interrupted

START = ("import json, sys; sys.path[:] = sys.argv[1:]; import convert; request = json.loads(sys.stdin.readline()); "
         "sys.path[:] = request.pop('path'); from convert.child import main; main(request)")


class Child:
    """Converts as `request` says: the options of the command, and "program", the path of Graupel."""

    def __init__(self, request):
        folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
        self.output = request["output"]
        if not sys.executable:
            raise ConfigError("this program does not know its Python (sys.executable is empty), which converts. Set it")
        # -I: what is imported is found by the parent's path. A session of its own: Ctrl-C reaches the parent alone.
        self.process = subprocess.Popen(
            [sys.executable, "-I", "-X", f"utf8={sys.flags.utf8_mode}", "-c", START, folder], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, bufsize=0, start_new_session=True,
            env={**os.environ, "HDF5_PLUGIN_PRELOAD": "::"})  # files must not load filters from the disk
        self._send({**request, "path": [place for place in sys.path if isinstance(place, str)]})

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        """Stops the child where it still runs; it removes what it has written."""
        if kind is not None:
            self.process.terminate()
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()

    def _send(self, message):
        try:
            self.process.stdin.write(json.dumps(message).encode() + b"\n")
        except BrokenPipeError:  # its last message, or its status, says why it has ended
            pass

    def messages(self):
        """Every message of the child, which goes on when the next one is asked for."""
        for line in self.process.stdout:
            yield json.loads(line)
            self._send("go on")
        if self.process.wait() != 0:
            shutil.rmtree(f"{os.path.abspath(self.output)}.{self.process.pid}.part", ignore_errors=True)
            yield {"error": [1, f"the conversion ended with status {self.process.returncode}"]}


class Parent:
    """Where the child's messages go."""

    def __init__(self):
        self.file = os.fdopen(os.dup(1), "w", encoding="ascii")
        os.dup2(2, 1)  # what libraries print is no message

    def send(self, message):
        self.file.write(json.dumps(message) + "\n")
        self.file.flush()

    def progress(self, done, total):
        try:
            self.send({"progress": [done, total]})
        except OSError:
            stop()
        if not sys.stdin.readline():
            stop()

    def end(self, message):
        """The last message. The process ends at once, before h5py's objects are freed (command.ended)."""
        try:
            self.send(message)
        finally:
            os._exit(0)


def stop(*_):
    raise Interrupted("the conversion was stopped; nothing was written")


def main(request):
    """The child."""
    sys.excepthook = sys.unraisablehook = lambda *_: None  # h5py reports there what it cannot close
    parent = Parent()
    signal.signal(signal.SIGTERM, stop)
    try:
        from .command import result_of
        from .conversion import Conversion
        from .scenes import Program
        program = Program(request.pop("program"))
        options = argparse.Namespace(**request)
        conversion = Conversion(options, program, parent.progress)
        conversion.run()
        parent.end({"result": result_of(options, conversion)})
    except ConvertError as error:
        parent.end({"error": [error.code, str(error)]})
    except ImportError as error:
        parent.end({"error": [2, f"converting data sets needs h5py ({error}). Run pip install h5py"]})
    except MemoryError:
        parent.end({"error": [1, "out of memory. Convert fewer or smaller trajectories"]})
    except Exception:
        parent.end({"error": [1, "the conversion failed\n" + traceback.format_exc()]})
