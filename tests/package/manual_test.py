#!/usr/bin/env python3
"""Man pages and completion: they know all that --help tells, pages are valid, and shells offer what fits.

    /usr/bin/python3 tests/package/manual_test.py [BUILD]      (tests/run_all.sh runs it)

Needs bash; mandoc, groff, zsh and fish are used where they are installed.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from shells import offered_by_bash, offered_by_fish, offered_by_zsh

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.abspath(sys.argv.pop(1) if len(sys.argv) > 1 and not sys.argv[1].startswith("-") else
                        os.path.join(ROOT, "build"))
PROGRAM = os.path.join(BUILD, "graupel")
OFFERED = {"bash": offered_by_bash, "zsh": offered_by_zsh, "fish": offered_by_fish}


def run(*words, **options):
    done = subprocess.run(words, capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


def help_of(words):
    return run(PROGRAM, *words, "--help", cwd=ROOT)


def commands_in(text):
    """Those below "Subcommands:" of a help text."""
    listed = text.split("\nSubcommands:\n")
    return re.findall(r"^  (\S+)", re.split(r"\n\S", listed[1])[0], re.M) if len(listed) > 1 else []


def flags_in(text):
    """Those at the left edge of a help text."""
    found = re.findall(r"^  (-\S+(?:[ ,]+-[-\w]+|,? [A-Z{][^ ]*,? -[-\w]+)*)", text, re.M)
    return sorted({flag for line in found for flag in re.findall(r"(?<![\w-])--?[a-z][\w-]*", line)})


def all_commands(words=()):
    """All whose programs were built: train and bench start others."""
    if not words or words[0] not in ("train", "bench") or os.path.exists(PROGRAM + "-" + words[0]):
        yield words
        for name in commands_in(help_of(words)):
            yield from all_commands(words + (name,))


class ManualTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="graupel-manual-")
        run(PROGRAM, "man", "--folder", cls.folder)
        cls.script = {}
        for shell in OFFERED:
            cls.script[shell] = os.path.join(cls.folder, shell)
            run(PROGRAM, "completion", shell, "-o", cls.script[shell])
        cls.place = os.path.join(cls.folder, "place")
        os.makedirs(os.path.join(cls.place, "a folder"))
        for name in ("one.json", "two.json", "run.h5", "net.safetensors", "old net.safetensors", "notes.txt", "run.state"):
            open(os.path.join(cls.place, name), "w", encoding="utf-8").close()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def page(self, words):
        with open(os.path.join(self.folder, "-".join(("graupel",) + words) + ".1"), encoding="utf-8") as page:
            return page.read()

    def test_pages_have_every_command_and_option_of_help(self):
        commands = list(all_commands())
        for words in (("simulate",), ("convert",), ("man",)):
            self.assertIn(words, commands)
        if os.path.exists(PROGRAM + "-train"):
            self.assertIn(("train", "hgn"), commands)
        for words in commands:
            text, page = help_of(words), self.page(words).replace("\\-", "-")
            flags = flags_in(text)
            self.assertTrue(flags, words)
            for flag in flags:
                self.assertIn(f"\\fB{flag}\\fR", page, words)
            for name in commands_in(text):
                self.assertIn(f"\\fB{name}\\fR\n", page, words)

    def test_pages_have_no_mistakes(self):
        pages = sorted(os.path.join(self.folder, name) for name in os.listdir(self.folder) if name.endswith(".1"))
        if shutil.which("mandoc"):
            self.assertEqual(run("mandoc", "-T", "lint", "-W", "warning", *pages), "")
        if shutil.which("groff"):
            for page in pages:
                done = subprocess.run(["groff", "-man", "-ww", "-z", page], capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stderr), (0, ""), page)

    def test_pages_show_text_as_it_is(self):
        if not shutil.which("mandoc"):
            self.skipTest("mandoc is not installed")
        page = run("mandoc", "-T", "ascii", os.path.join(self.folder, "graupel-simulate.1"))
        text = re.sub(".\b", "", page)
        self.assertIn("graupel simulate scenes/shared/water_steps.json -o steps.h5\n", text)
        self.assertRegex(text, r"--precision TEXT\n +f32 or f64\. One of: f32, f64\. Default: f32\.")

    def test_one_page_is_printed_and_unknown_ones_are_named(self):
        self.assertEqual(run(PROGRAM, "man", "simulate"), self.page(("simulate",)))
        done = subprocess.run([PROGRAM, "man", "simulat"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("'graupel-simulate'", done.stderr)

    def check(self, line, among=(), none_of=(), exactly=None):
        """What each shell offers; of files and lists the last part, which shells may give without what stands before."""
        for shell, offered in OFFERED.items():
            if not shutil.which(shell):
                continue
            found = {re.sub(r"^.*[,=:](?=.)|\\(?= )", "", word).rstrip("/") for word in
                     offered(self.script[shell], "graupel " + line, self.place)}
            with self.subTest(shell=shell, line=line, found=found):
                self.assertLessEqual(set(among), found)
                self.assertFalse(set(none_of) & found)
                if exactly is not None:
                    self.assertEqual(found, set(exactly))

    def test_commands(self):
        self.check("", among=("simulate", "train", "view", "man"), none_of=("hgn", "one.json"))
        self.check("sim", exactly=("simulate",))
        self.check("simulate sim", exactly=())
        self.check("completion ", exactly=("bash", "zsh", "fish"))

    def test_commands_of_other_programs(self):
        if os.path.exists(PROGRAM + "-train"):
            self.check("train ", among=("hgn", "crom"), none_of=("simulate",))
            self.check("train hgn --pre", exactly=("--preset",))
            self.check("train hgn --preset ", exactly=("recommended", "paper"))
        if os.path.exists(PROGRAM + "-bench"):
            self.check("bench mpm --phase ", exactly=("fall", "late"))
        self.check("convert --form", exactly=("--format",))
        self.check("convert --format ", exactly=("graupel", "gns", "lagrangebench", "tfrecord"))

    def test_options(self):
        self.check("simulate --prec", exactly=("--precision",))
        self.check("simulate one.json -o run.h5 --sav", exactly=("--save-state", "--save-every"))
        self.check("rollout --prec", exactly=())

    def test_values_that_are_enumerated(self):
        self.check("simulate --precision ", exactly=("f32", "f64"))
        self.check("simulate --precision=f3", exactly=("f32",))
        self.check("export run.h5 -f us", exactly=("usda",))
        self.check("view --device ", exactly=("auto", "cpu", "cuda"))
        self.check("simulate --frames ", exactly=())

    def test_values_in_lists(self):
        self.check("compare --models mpm,mpm:f", exactly=("fast", "fine"))
        self.check("compare --models mpm:coarse,net", exactly=("net.safetensors",))

    def test_files_by_their_endings(self):
        self.check("simulate ", exactly=("one.json", "two.json", "a folder"))
        self.check("simulate one.json --resume ", exactly=("run.state", "a folder"))
        self.check("simulate one.json -o r", exactly=("run.h5",))
        self.check("rollout ", exactly=("net.safetensors", "old net.safetensors", "a folder"))
        self.check("rollout net.safetensors ", exactly=("one.json", "two.json", "run.h5", "a folder"))
        self.check("view run.h5 r", exactly=("run.h5",))
        self.check("generate one.json --output ", exactly=("a folder",))

    def test_bash_completes_on_a_terminal(self):
        from shells import Terminal
        terminal = Terminal(["bash", "--norc", "-i"], self.place)
        try:
            terminal.type(f"PS1=; bind 'set bell-style none'; source {self.script['bash']}; echo sour''ced\n")
            terminal.read_until("sourced\r\n")
            terminal.type("graupel simul\t--prec\tf6\tone.j\t")
            terminal.read_until("graupel simulate --precision f64 one.json")
            terminal.type("\x15graupel rollout old\t")
            terminal.read_until("graupel rollout old\\ net.safetensors")
            terminal.type("\x15exit\n")
        finally:
            terminal.close()


if __name__ == "__main__":
    unittest.main()
