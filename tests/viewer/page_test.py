#!/usr/bin/env python3
"""Keys, pointer and messages of the viewer's page, in headless Chromium. Needs build/graupel; status 77 without chromium."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from devtools import Page  # noqa: E402

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.path.join(ROOT, "build", "graupel")


def falling(frames, height=0.4, **more):
    return {"name": "falling", "domain": {"dx": 0.04}, "materials": {"water": {"preset": "taichi_water"}},
            "sources": [{"shape": "box", "size": [0.3, 0.3, 0.3], "position": [0.5, height, 0.5],
                         "velocity": [0, -1, 0], "material": "water"}],
            "time_step": {"policy": "fixed", "substeps_per_frame": 40}, "frame_time": 0.01, "frames": frames, **more}


class Viewer:
    """`graupel view FILES`."""

    def __init__(self, *files):
        self.process = subprocess.Popen([PROGRAM, "view", *files], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.address = self.process.stdout.readline().strip()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(30)
        self.process.stdout.close()


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        for name, frames in (("long", 12), ("short", 6)):
            cls.write(name, falling(frames))
            subprocess.run([PROGRAM, "simulate", cls.file(name + ".json"), "-o", cls.file(name + ".h5"), "--device", "cpu"],
                           check=True, capture_output=True)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    @classmethod
    def file(cls, name):
        return os.path.join(cls.place.name, name)

    @classmethod
    def write(cls, name, scene):
        with open(cls.file(name + ".json"), "w", encoding="utf-8") as file:
            json.dump(scene, file)

    def shown(self, page):
        page.wait("document.documentElement.dataset.view === 'shown'", "no picture")

    def frame(self, page, number):
        page.wait(f"document.getElementById('time').innerText.startsWith('frame {number} ')", f"not frame {number}")

    def test_keys_go_through_the_frames(self):
        with Viewer(self.file("long.h5")) as viewer, Page(viewer.address) as page:
            self.shown(page)
            for key, shift, number in (("ArrowRight", False, 1), ("ArrowRight", True, 11), ("ArrowLeft", False, 10),
                                       ("End", False, 12), ("Home", False, 0)):
                page.press(key, shift)
                self.frame(page, number)
            page.press(" ")
            page.wait("document.getElementById('play').getAttribute('aria-label') === 'Pause'", "it does not play")
            page.wait("!document.getElementById('time').innerText.startsWith('frame 0 ')", "time stands still")
            page.press(" ")
            page.wait("document.getElementById('play').getAttribute('aria-label') === 'Play'", "it does not pause")
            self.assertEqual(page.errors, [])

    def test_the_last_frame_has_a_speed(self):
        with Viewer(self.file("long.h5")) as viewer, Page(viewer.address + "#color=speed") as page:
            self.shown(page)
            page.press("End")
            self.frame(page, 12)
            page.wait("(document.getElementById('fit').click(), Number(document.getElementById('scale').value) > 0.5)",
                      "falling water is slower than 0.5 m/s")

    def test_the_pointer_turns_shifts_and_scales(self):
        with Viewer(self.file("long.h5")) as viewer, Page(viewer.address) as page:
            self.shown(page)
            pictures = [page.picture()]

            def is_another():
                page.wait("document.documentElement.dataset.view === 'shown'", "no picture")
                for _ in range(40):
                    picture = page.picture()
                    if picture not in pictures:
                        pictures.append(picture)
                        return
                self.fail(f"the picture stays after action {len(pictures)}")

            page.drag((300, 300), (420, 330))
            is_another()
            page.drag((300, 300), (330, 360), "right")
            is_another()
            page.mouse("mouseWheel", 300, 300, deltaX=0, deltaY=-400)
            is_another()
            self.assertEqual(page.errors, [])

    def test_no_error_after_the_end_of_one_run(self):
        with Viewer(self.file("short.h5"), self.file("long.h5")) as viewer, \
                Page(viewer.address + "#frame=6&color=error") as page:
            self.shown(page)
            page.wait("document.getElementById('legend').innerText.includes('mean 0 m')", "equal runs differ")
            page.press("End")
            self.frame(page, 12)
            page.wait("document.getElementById('label-0').innerText.includes('ends at 0.06 s')", "the end is not told")
            page.wait("document.getElementById('legend').innerText === 'No error: one run has ended before'",
                      "an error of other times")

    def test_a_restart_that_is_refused_says_why_until_the_next(self):
        self.write("live", falling(300))
        with Viewer(self.file("live.json"), "--device", "cpu") as viewer, Page(viewer.address) as page:
            self.shown(page)
            self.write("live", falling(300, gravity=[0, 1]))
            page.value("document.getElementById('live-restart').click()")
            page.wait("document.getElementById('live-text').innerText.includes('/gravity')", "no reason")
            time.sleep(0.6)  # four questions for the run's state
            self.assertIn("/gravity", page.text("live-text"))
            self.write("live", falling(300))
            page.value("document.getElementById('live-restart').click()")
            page.wait("/running|done/.test(document.getElementById('live-text').innerText)", "the reason stays")


if __name__ == "__main__":
    if shutil.which("chromium") is None:
        print("needs the package chromium")
        sys.exit(77)
    unittest.main()
