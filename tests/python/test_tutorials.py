"""The tutorials run in empty folders; those with PyTorch are skipped where it is not there."""
import glob
import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
FOLDERS = [os.path.join(HERE, "tutorials"), os.path.join(HERE, "..", "..", "library", "python", "tutorials")]
FILES = sorted(file for folder in FOLDERS for file in glob.glob(os.path.join(folder, "[0-9]_*.py")))


class TutorialsTest(unittest.TestCase):
    def run_tutorial(self, file):
        with open(file, encoding="utf-8") as text:
            if "import torch" in text.read() and importlib.util.find_spec("torch") is None:
                self.skipTest("torch is not installed")
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, os.path.abspath(file)], cwd=folder, capture_output=True, text=True,
                                  check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("\n", done.stdout)

    def test_there_are_five(self):
        self.assertEqual(sorted({os.path.basename(file)[0] for file in FILES}), list("12345"))


for number, path in enumerate(FILES[:5], 1):
    name = "test_" + os.path.basename(path)[2:-3]
    setattr(TutorialsTest, name, lambda self, file=path: self.run_tutorial(file))


if __name__ == "__main__":
    unittest.main()
