#!/usr/bin/env python3
"""Markdown: links lead to files and headings that exist, named sources exist, README and decisions are a page each.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/tools/docs_test.py
"""
import os
import re
import subprocess
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WIDTH = 120


def markdown_files():
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT, capture_output=True,
                            text=True, check=True).stdout.split()
    return [file for file in listed if os.path.exists(os.path.join(ROOT, file))]


def read(file):
    with open(os.path.join(ROOT, file), encoding="utf-8") as handle:
        return handle.read()


def without_code(text):
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(text):
    """The names that GitHub gives to headings."""
    names = []
    for heading in re.findall(r"^#+ +(.*?) *$", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M), re.M):
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        names.append(f"{name}-{names.count(name)}" if name in names else name)
    return names


def broken_links(file, text):
    broken = []
    links = re.findall(r"\]\(([^)\s]+)\)", without_code(text)) + re.findall(r'(?:src|href)="([^"]+)"', text)
    for link in links:
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = os.path.normpath(os.path.join(os.path.dirname(file), path)) if path else file
        if target != file and not os.path.exists(os.path.join(ROOT, target)):
            broken.append(f"{file}: {link}")
        elif anchor and target.endswith(".md") and anchor not in anchors(text if target == file else read(target)):
            broken.append(f"{file}: {link} (no such heading)")
    return broken


def long_lines(file, text):
    """Tables, pictures and lines that are one word or link may be longer."""
    return [f"{file}:{number}" for number, line in enumerate(text.split("\n"), 1)
            if len(line) > WIDTH and not line.startswith("|") and not line.startswith("!") and " " in line.strip()]


def missing_sources(file, text):
    folders = "apps|bench|compare|core|experiments|graph|io|library|mpm|nn|rom|sparsegrid|tests|tools|train|validation"
    named = re.findall(rf"`((?:{folders})/[\w/.-]+\.(?:h|cpp|cu|cuh|py|sh))`", text)
    return [f"{file}: {path}" for path in named if not os.path.exists(os.path.join(ROOT, path))]


class DocsTest(unittest.TestCase):
    def test_links_lead_somewhere(self):
        self.assertGreater(len(markdown_files()), 20)
        self.assertEqual([link for file in markdown_files() for link in broken_links(file, read(file))], [])

    def test_a_broken_link_is_found(self):
        text = "# A b\n[a](no/such.md) [b](README.md#quick-start) [c](#a-b) [d](#a-c) `[e](none.md)` [f](https://x.y/z)\n"
        self.assertEqual(broken_links("x.md", text), ["x.md: no/such.md", "x.md: #a-c (no such heading)"])

    def test_lines_have_120_characters_at_most(self):
        self.assertEqual([line for file in markdown_files() for line in long_lines(file, read(file))], [])
        self.assertEqual(long_lines("x.md", "a " * 61 + "\n| " + "a " * 61), ["x.md:1"])

    def test_sources_that_pages_name_exist(self):
        pages = [file for file in markdown_files() if file != "CHANGELOG.md"]
        self.assertEqual([path for file in pages for path in missing_sources(file, read(file))], [])
        self.assertEqual(missing_sources("x.md", "`core/math/vec.h` `core/no.h`"), ["x.md: core/no.h"])

    def test_the_readme_is_a_page(self):
        lines = read("README.md").split("\n")
        self.assertLessEqual(len(lines) - 1, 90)
        self.assertLessEqual(max(map(len, lines)), WIDTH)

    def test_decisions_are_a_page_each(self):
        long = {file: read(file).count("\n") for file in markdown_files() if file.startswith("docs/decisions/")}
        self.assertGreater(len(long), 10)
        self.assertEqual({file: lines for file, lines in long.items() if lines > 40}, {})

    def test_every_page_is_in_the_index(self):
        index = read("docs/README.md")
        pages = [file[5:] for file in markdown_files() if file.startswith("docs/") and file != "docs/README.md"]
        self.assertEqual([page for page in pages if f"({page})" not in index], [])


if __name__ == "__main__":
    unittest.main()
