"""The package itself: stubs, docstrings, the program, processors that it needs."""
import ast
import builtins
import inspect
import os
import re
import subprocess
import sys
import unittest
import warnings

import graupel
from graupel import _graupel, _machine

FOLDER = os.path.dirname(graupel.__file__)


class PackageTest(unittest.TestCase):
    def test_stubs_name_what_there_is(self):
        self.assertTrue(os.path.exists(os.path.join(FOLDER, "py.typed")))
        with open(os.path.join(FOLDER, "_graupel.pyi"), encoding="utf-8") as file:
            stub = file.read()
        tree = ast.walk(ast.parse(stub, "_graupel.pyi"))
        used, known = set(), set(dir(builtins))
        for node in tree:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                known |= {alias.asname or alias.name for alias in node.names}
            elif isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                known.add(node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                used.add(node.id)
        self.assertEqual(used - known, set())
        self.assertIn("__version__: str", stub)
        for name in ("Batch", "GpuArray", "Scene", "Simulation", "Trajectory", "NetworkModel", "ReducedModel"):
            self.assertIn(f"class {name}:", stub)
            for member in vars(getattr(_graupel, name)):
                if not member.startswith("_"):
                    self.assertRegex(stub, rf"def {member}\b", f"{name}.{member}")

    def test_public_things_have_docstrings_with_shapes_and_units(self):
        for name in graupel.__all__:
            if name != "__version__":
                self.assertTrue(inspect.getdoc(getattr(graupel, name)), name)
        for cls, member, words in ((graupel.Simulation, "positions", ("[particles, 3]", "m")),
                                   (graupel.Simulation, "velocities", ("[particles, 3]", "m/s")),
                                   (graupel.Simulation, "field", ("[n, 6] Pa", "1/s")),
                                   (graupel.Batch, "positions", ("[particles, 3]", "m")),
                                   (graupel.Batch, "field", ("[n, 6]", "Pa", "1/s")),
                                   (graupel.Trajectory, "positions", ("[frames, particles, 3]",)),
                                   (graupel.Scene, "with_particles", ("[n, 3, 3]", "m^3"))):
            text = inspect.getdoc(inspect.getattr_static(cls, member)) or getattr(cls, member).__doc__
            for word in words:
                self.assertIn(word, text, f"{cls.__name__}.{member}")

    def test_the_program_comes_along(self):
        done = subprocess.run([sys.executable, "-c", "from graupel._program import main; main()", "--help"],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("simulate", done.stdout)

    def test_instruction_sets_are_chosen_at_run_time(self):
        self.assertIn(graupel.instruction_set(), ("baseline", "avx2", "avx512"))
        if "native" not in os.environ.get("GRAUPEL_WHEEL", ""):  # wheel_test.py --in-build: flags of this processor
            self.assertFalse(_graupel._native)
        code = "import graupel; print(graupel.instruction_set())"
        done = subprocess.run([sys.executable, "-c", code], env={**os.environ, "GRAUPEL_SIMD": "baseline"},
                              capture_output=True, text=True, check=True)
        self.assertEqual(done.stdout.strip(), "baseline")

    def test_processors_without_what_is_needed_are_told(self):
        flags = _machine.processor_flags("processor : 0\nflags\t\t: fpu sse sse2 ssse3\nflags : avx2\n")
        self.assertEqual(flags, {"fpu", "sse", "sse2", "ssse3"})
        self.assertRegex(_machine.check_processor("x86_64", flags), "no AVX2")
        self.assertEqual(_machine.check_processor("x86_64", flags | {"avx2", "fma"}), "")
        self.assertEqual(_machine.check_processor("x86_64", set()), "")  # nothing is known
        with self.assertRaisesRegex(ImportError, "SSE2"):
            _machine.check_processor("x86_64", {"fpu"})

    def test_a_warning_comes_at_import_without_avx2(self):
        code = ("import warnings, importlib.util, sys; sys.modules.pop('graupel', None)\n"
                "import builtins, io; real = builtins.open\n"
                "def fake(path, *a, **k):\n"
                "    return io.StringIO('flags : sse2\\n') if path == '/proc/cpuinfo' else real(path, *a, **k)\n"
                "builtins.open = fake\nimport graupel\n")
        done = subprocess.run([sys.executable, "-W", "always", "-c", code], capture_output=True, text=True, check=True)
        self.assertIn("RuntimeWarning: this processor has no AVX2", done.stderr)

    def test_sources_without_the_module_say_what_to_do(self):
        import shutil
        import tempfile
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(FOLDER, os.path.join(folder, "graupel"),
                            ignore=lambda place, names: [n for n in names if re.search(r"\.so$|^share$|^bin$", n)])
            done = subprocess.run([sys.executable, "-c", "import graupel"], cwd=folder, capture_output=True, text=True,
                                  env={**os.environ, "PYTHONPATH": folder}, check=False)
            self.assertIn("pip wheel .", done.stderr)

    def test_the_environment_is_as_before(self):
        code = "import os; before = dict(os.environ); import graupel; assert dict(os.environ) == before"
        subprocess.run([sys.executable, "-c", code], check=True)

    def test_nothing_is_warned_of_here_or_it_is_avx2(self):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            _machine.load_module()
        self.assertTrue(all("AVX2" in str(w.message) for w in caught))


if __name__ == "__main__":
    unittest.main()
