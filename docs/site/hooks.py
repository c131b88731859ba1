"""What mkdocs does not know of this repository: pages outside of docs/, navigation from docs/README.md, links to sources.

A link of a page leads to another page where its target is one, else to a copy of the file or folder below files/.
"""
import os
import re
import subprocess

import yaml
from mkdocs.structure.files import File

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# Pages outside of docs/: address in the site by place in the repository.
OUTSIDE = {"README.md": "index.md", "docs/README.md": "documentation.md", "CHANGELOG.md": "project/changelog.md",
           "CONTRIBUTING.md": "project/contributing.md", "models/README.md": "project/models.md",
           "scenes/README.md": "project/scenes.md", "scenes/crom/README.md": "project/scenes-crom.md",
           "scenes/nsf/README.md": "project/scenes-nsf.md", "examples/README.md": "project/examples.md",
           "bench/README.md": "project/benchmarks.md", "tests/golden/README.md": "project/golden.md"}
CITATION = "project/citation.md"
PICTURE = re.compile(r"\.(png|svg|jpg|gif)$")
sources = {}  # address in the site -> place in the repository
copies = {}   # place in the repository -> address of the copy
versioned = []


def read(place):
    with open(os.path.join(ROOT, place), encoding="utf-8") as file:
        return file.read()


def navigation():
    """The sections and pages of the index docs/README.md, between the front page and the project's own."""
    sections = [{"Home": ["index.md", "documentation.md"]}]
    for title, body in re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", read("docs/README.md"), re.M | re.S):
        pages = [{name[0].upper() + name[1:]: page} for name, page in re.findall(r"\[([^\]]+)\]\(([^)#]+\.md)\)", body)]
        decisions = [page for page in pages if list(page.values())[0].startswith("decisions/")]
        pages = [page for page in pages if page not in decisions]
        sections.append({title.split(":")[0]: pages + ([{"Decisions": decisions}] if decisions else [])})
    titles = {"Changelog": "CHANGELOG.md", "Contributing": "CONTRIBUTING.md", "Models": "models/README.md",
              "Scenes": "scenes/README.md", "Scenes of CROM": "scenes/crom/README.md",
              "Scenes of NSF": "scenes/nsf/README.md", "Examples in C++": "examples/README.md",
              "Benchmarks": "bench/README.md", "Comparison of builds": "tests/golden/README.md"}
    return sections + [{"Project": [{"How to cite": CITATION}] + [{k: OUTSIDE[v]} for k, v in titles.items()]}]


def citation():
    """CITATION.cff as a page."""
    facts = yaml.safe_load(read("CITATION.cff"))
    authors = " and ".join(author["name"] for author in facts["authors"])
    return (f"# How to cite\n\n{facts['message']}\n\n{facts['abstract']}\n\n```bibtex\n@software{{graupel,\n"
            f"  title = {{{facts['title']}}},\n  author = {{{{{authors}}}}},\n  version = {{{facts['version']}}},\n"
            f"  license = {{{facts['license']}}}\n}}\n```\n\nThe papers are named where their methods are explained: "
            "[method](../reference/method.md). The same in the Citation File Format: [CITATION.cff](../../CITATION.cff).\n")


def on_config(config):
    global versioned
    versioned = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True,
                               check=True).stdout.split("\n")
    config.nav = navigation()
    return config


def on_files(files, config):
    for file in files.documentation_pages():
        sources[file.src_uri] = "docs/" + file.src_uri
    for place, page in OUTSIDE.items():
        sources[page] = place
        existing = files.get_file_from_path(page)
        if existing:
            files.remove(existing)
        files.append(File.generated(config, page, content=read(place)))
    sources[CITATION] = "docs/project/citation.md"
    files.append(File.generated(config, CITATION, content=citation()))
    for page in list(sources):
        for target in targets_of(page, files.get_file_from_path(page).content_string):
            add_copy(target, files, config)
    return files


LINK = re.compile(r"(\]\(|(?:src|href)=\")([^)\s\"]+)")


def without_code(text):
    """Code of the same length without links."""
    blank = lambda code: re.sub(r"[^\n]", " ", code.group(0))
    return re.sub(r"`[^`\n]*`", blank, re.sub(r"^```.*?^```", blank, text, flags=re.S | re.M))


def place_of(page, link):
    return os.path.normpath(os.path.join(os.path.dirname(sources[page]), link.partition("#")[0]))


def targets_of(page, text):
    """Places in the repository that the page's links name."""
    links = [link for _, link in LINK.findall(without_code(text)) if not re.match(r"[a-z]+:|#", link)]
    return sorted({place_of(page, link) for link in links})


def is_page(place):
    return place in OUTSIDE or place == "docs/project/citation.md" or (place.startswith("docs/") and place.endswith(".md"))


def add_copy(place, files, config):
    """Files are copied with .txt behind, so that browsers show them; a folder becomes a list of its files."""
    if is_page(place) or place in copies or place.startswith("docs/"):
        return
    if os.path.isdir(os.path.join(ROOT, place)):
        inside = [file for file in versioned if file.startswith(place + "/")]
        copies[place] = f"files/{place}/index.md"
        for file in inside:
            add_copy(file, files, config)
        text = f"# {place}\n\n" + "".join(
            f"- [{file[len(place) + 1:]}]({os.path.relpath(copies[file], 'files/' + place)})\n" for file in inside)
        files.append(File.generated(config, copies[place], content=text))
        sources[copies[place]] = copies[place]
    elif place in versioned:
        shown = PICTURE.search(place) or place.endswith((".json", ".txt"))
        copies[place] = f"files/{place}" + ("" if shown else ".txt")
        files.append(File.generated(config, copies[place], abs_src_path=os.path.join(ROOT, place)))


def address_of(place):
    """In the site; None where nothing is there."""
    if place in OUTSIDE:
        return OUTSIDE[place]
    if place.startswith("docs/"):
        return place[5:]
    return copies.get(place)


def on_page_markdown(markdown, page, config, files):
    here = page.file.src_uri
    if here.startswith("files/"):
        return markdown
    plain = without_code(markdown)
    out, at = "", 0
    for link in LINK.finditer(plain):
        target = link.group(2)
        if re.match(r"[a-z]+:|#", target):
            continue
        address = address_of(place_of(here, target))
        anchor = "#" + target.partition("#")[2] if "#" in target else ""
        if address is not None:
            out += markdown[at:link.start(2)] + os.path.relpath(address, os.path.dirname(here)) + anchor
            at = link.end(2)
    markdown = out + markdown[at:]
    # A list may follow its introduction at once; Python-Markdown wants a line between them.
    return re.sub(r"(?m)^((?![-*] |\d+\. |[ #|]).+)\n(?=[-*] |1\. )", r"\1\n\n", markdown)


def on_post_page(output, page, config):
    """The theme's search needs a script of another site where pages are opened from the disk: ours takes its place."""
    ours = os.path.relpath("site/worker.js", os.path.dirname(page.file.dest_uri))
    return output.replace("https://unpkg.com/iframe-worker/shim", ours)


def on_post_template(output, template_name, config):
    """The page of unknown addresses is never opened from the disk."""
    return re.sub(r'<script src="https://unpkg[^>]*></script>', "", output)
