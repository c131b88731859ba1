#!/usr/bin/env python3
"""The installed package: public headers compile alone and show no other library, the examples build and run, the
programs find their siblings, tools, models and scenes.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/package/package_test.py [BUILD]
"""
import multiprocessing.pool
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.abspath(sys.argv.pop(1) if len(sys.argv) > 1 and not sys.argv[1].startswith("-") else
                        os.path.join(ROOT, "build"))
HEAVY = re.compile(r"nanovdb|openvdb|/CLI/|nlohmann|[Ee]igen|cuda|hdf5|/tbb/|/fmt/|/omp\.h|/png|torch")


def cached(name):
    """A value of the build's CMakeCache.txt; "" where it has none."""
    with open(os.path.join(BUILD, "CMakeCache.txt"), encoding="utf-8") as cache:
        found = re.search(rf"^{name}:\w+=(.*)$", cache.read(), re.M)
    return found.group(1) if found else ""


def run(*words, cwd=None):
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(words)}\n{done.stdout[-4000:]}{done.stderr[-4000:]}")
    return done.stdout + done.stderr


def files_under(folder, ending):
    return sorted(os.path.join(place, name) for place, _, names in os.walk(folder) for name in names
                  if name.endswith(ending))


class PackageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="graupel-package-")
        first = os.path.join(cls.folder, "first")
        for component in ("library", "checkers", "data"):
            run("cmake", "--install", BUILD, "--prefix", first, "--component", component)
        cls.prefix = os.path.join(cls.folder, "moved")
        os.rename(first, cls.prefix)  # a package that remembers its first place fails all tests
        cls.include = os.path.join(cls.prefix, "include")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def dependencies(self, source):
        """The headers that a source reads, with the package's headers and those of the system alone."""
        listed = source + ".d"
        run(cached("CMAKE_CXX_COMPILER"), "-std=c++20", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fsyntax-only", "-MD",
            "-MF", listed, "-I", self.include, source)
        with open(listed, encoding="utf-8") as text:
            return text.read().replace("\\\n", " ").split()[2:]

    def test_public_headers_compile_alone_and_show_no_other_library(self):
        headers = files_under(self.include, ".h")
        for name in ("io", "mpm", "graph", "rom"):
            self.assertIn(os.path.join(self.include, "graupel", name + ".h"), headers)

        def others_of(header):
            source = os.path.join(self.folder, f"alone{headers.index(header)}.cpp")
            name = os.path.relpath(header, self.include)
            with open(source, "w", encoding="utf-8") as text:
                text.write(f"#include <{name}>\n#include <{name}>\nint main() {{}}\n")
            return [path for path in self.dependencies(source) if not path.startswith(self.include)]

        with multiprocessing.pool.ThreadPool(os.cpu_count()) as pool:
            found = dict(zip(headers, pool.map(others_of, headers)))
        self.assertTrue(all(found.values()))
        self.assertEqual({header: [path for path in others if HEAVY.search(path)] for header, others in found.items()},
                         {header: [] for header in headers})

    def test_a_header_that_shows_another_library_is_found(self):
        source = os.path.join(self.folder, "heavy.cpp")
        with open(source, "w", encoding="utf-8") as text:
            text.write("#include <graupel/mpm.h>\n#include <nlohmann/json.hpp>\n")
        self.assertTrue(any(HEAVY.search(path) for path in self.dependencies(source)))
        with open(source, "w", encoding="utf-8") as text:
            text.write('#include <graupel/mpm.h>\n#include "core/math/vec.h"\n')
        with self.assertRaises(AssertionError):  # there is nothing of Graupel beside graupel/
            self.dependencies(source)

    def test_nothing_of_the_package_knows_where_it_was_built(self):
        for file in files_under(os.path.join(self.prefix, "lib"), ".cmake"):
            with open(file, encoding="utf-8") as text:
                content = text.read()
            for place in (BUILD, ROOT, os.path.join(self.folder, "first")):
                self.assertNotIn(place, content, file)

    def test_examples_build_and_run(self):
        sources, build = os.path.join(self.folder, "examples"), os.path.join(self.folder, "build")
        shutil.copytree(os.path.join(ROOT, "examples"), sources)
        for file in files_under(sources, ".cpp"):
            with open(file, encoding="utf-8") as text:
                self.assertTrue(20 <= text.read().count("\n") <= 60, file)
        prefixes = ";".join(filter(None, [self.prefix, cached("CMAKE_PREFIX_PATH")]))
        run("cmake", "-S", sources, "-B", build, "-G", cached("CMAKE_GENERATOR"), "-DCMAKE_BUILD_TYPE=Release",
            f"-DCMAKE_PREFIX_PATH={prefixes}", f"-DCMAKE_CXX_COMPILER={cached('CMAKE_CXX_COMPILER')}",
            f"-DCMAKE_EXE_LINKER_FLAGS={cached('CMAKE_EXE_LINKER_FLAGS')}")
        run("cmake", "--build", build, "--parallel", "2")
        output = run("ctest", "--test-dir", build, "--output-on-failure")
        self.assertIn("100% tests passed, 0 tests failed out of 5", output)

    def test_programs_find_what_they_need(self):
        with open(os.path.join(BUILD, "cmake_install.cmake"), encoding="utf-8") as text:
            script = text.read()
        programs = [name for name in ("graupel", "graupel-bench", "graupel-train") if f'/{name}"' in script]
        missing = [name for name in programs if not os.path.exists(os.path.join(BUILD, name))]
        if missing:
            self.skipTest(f"not built: {', '.join(missing)}")
        run("cmake", "--install", BUILD, "--prefix", self.prefix, "--component", "programs")
        program = os.path.join(self.prefix, "bin", "graupel")
        self.assertIn("gns", run(program, "convert", "--help"))
        for name in programs[1:]:
            self.assertIn("usage", run(program, name.split("-")[1], "--help").lower())
        report = os.path.join(self.folder, "report.html")
        run(program, "demo", "--frames", "2", "-o", report, cwd=self.folder)
        self.assertTrue(os.path.exists(report))


if __name__ == "__main__":
    unittest.main()
