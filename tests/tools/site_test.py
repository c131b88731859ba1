#!/usr/bin/env python3
"""The site in build/site: links, anchors and pictures lead somewhere, nothing comes from the network, all is found.

    ./run site      builds it first
"""
import html.parser
import json
import os
import re
import subprocess
import unittest
import urllib.parse

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SITE = os.path.join(ROOT, "build", "site")


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.loaded, self.anchors, self.pictures = [], [], set(), 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        known = dict(attributes)
        self.anchors.update(filter(None, (known.get("id"), known.get("name"))))
        if tag == "a" and known.get("href"):
            self.links.append(known["href"])
        if tag in ("img", "script", "iframe") and known.get("src"):
            self.loaded.append(known["src"])
            self.pictures += tag == "img"
        if tag == "link" and known.get("rel") != "canonical" and known.get("href"):
            self.loaded.append(known["href"])


def pages_of(site):
    pages = {}
    for folder, _, names in os.walk(site):
        for name in names:
            if name.endswith(".html"):
                file = os.path.relpath(os.path.join(folder, name), site)
                with open(os.path.join(site, file), encoding="utf-8") as text:
                    pages[file] = Page(text.read())
    return pages


def broken(file, link, pages, exists):
    """Why a link of the page `file` leads nowhere; None where it does not."""
    if re.match(r"(https?|mailto):", link):
        return None
    path, _, anchor = link.partition("#")
    target = os.path.normpath(os.path.join(os.path.dirname(file), urllib.parse.unquote(path))) if path else file
    if target not in pages and not exists(target):
        return f"{file}: {link}"
    if anchor and target in pages and urllib.parse.unquote(anchor) not in pages[target].anchors and anchor != "__skip":
        return f"{file}: {link} (no such anchor)"
    return None


class SiteTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.pages = pages_of(SITE)
        cls.readable = {file: page for file, page in cls.pages.items() if file != "404.html"}

    def test_links_lead_somewhere(self):
        exists = lambda target: os.path.exists(os.path.join(SITE, target))
        links = [(file, link) for file, page in self.readable.items() for link in page.links + page.loaded]
        self.assertGreater(len(links), 5000)
        self.assertEqual([text for file, link in links if (text := broken(file, link, self.pages, exists))], [])

    def test_broken_links_are_found(self):
        pages = {"a/b.html": Page('<h2 id="c d">x</h2>'), "e.html": Page("")}
        nothing = lambda target: False
        self.assertIsNone(broken("e.html", "a/b.html#c%20d", pages, nothing))
        self.assertEqual(broken("a/b.html", "../f.html", pages, nothing), "a/b.html: ../f.html")
        self.assertEqual(broken("a/b.html", "#c", pages, nothing), "a/b.html: #c (no such anchor)")
        self.assertIsNone(broken("a/b.html", "https://x.y/z", pages, nothing))

    def test_nothing_comes_from_the_network(self):
        outside = [(file, link) for file, page in self.pages.items() for link in page.loaded if "//" in link]
        self.assertEqual(outside, [])

    def test_every_page_of_the_repository_is_there(self):
        listed = subprocess.run(["git", "ls-files", "docs/*.md"], cwd=ROOT, capture_output=True, text=True,
                                check=True).stdout.split()
        wanted = [file[5:-3] + ".html" for file in listed if file != "docs/README.md"]
        self.assertGreater(len(wanted), 40)
        front = {os.path.normpath(link.partition("#")[0]) for link in self.pages["index.html"].links}
        for file in wanted + ["documentation.html", "project/citation.html", "project/changelog.html"]:
            self.assertIn(file, self.pages)
            self.assertIn(file, front, "navigation")

    def test_pictures_and_formatting(self):
        self.assertGreater(self.pages["index.html"].pictures, 0)
        self.assertGreater(self.pages["lab/validation.html"].pictures, 5)
        self.assertIn("../files/examples/own_material.cpp.txt", self.pages["guide/library.html"].links)

    def test_search_finds_words_of_pages(self):
        with open(os.path.join(SITE, "search", "search_index.json"), encoding="utf-8") as text:
            documents = json.load(text)["docs"]
        found = {entry["location"].partition("#")[0] for entry in documents if "Sinkhorn" in entry["text"]}
        self.assertIn("reference/metrics.html", found)


if __name__ == "__main__":
    unittest.main()
