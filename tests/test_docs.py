"""The documentation runs: Python, commands and design files as they stand, and what they print.

A fence in `README.md` or `docs/` is one of these, or the test fails:

- `python`: executed, in order, in one namespace per page and a folder that is empty at first. One
  that cannot be says why in its first line: `# not executed: REASON`. One that begins with a name,
  `# magnets.py`, is written to a file of this name, from which others can import.
- `bash`: lines that begin with `softreach` are executed in the same folder; a line ending in
  `# exit code 2` must fail so, one in `# exit code 1` find a requirement missed, and
  `softreach studio` is ended once it serves its page; with `--static` it ends by itself. Other
  lines set up a machine and are not executed.
- `python` or `bash` that begins with `# takes a minute` is executed by `make test-all` only.
- `toml`: read as a design; with `[[reach]]` or `[search]`, as requirements.
- `text` right after one of these: what it printed. Numbers may differ by 0.1 %; `...` stands for
  anything up to the end of the line.
- `bibtex`, `julia`: for other programs.

Where no `text` follows, Python and commands are executed with few samples.
"""

import ast
import io
import json
import math
import re
import shlex
import signal
import subprocess
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from sybil.document import Document
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import CodeBlockParser
from sybil.region import Lexeme
from tools.address import SPELLED_OUT, address

import softreach as sr
from softreach.cli.app import run

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
SETUP = {"pip", "make", "git", "cd", "python3", "export"}
FEW = 5_000  # samples
NOT_EXECUTED = re.compile(r"# not executed: \w.+")
LONG = "# takes a minute"
FILE = re.compile(r"# (\w+\.py)\n")
FENCE = re.compile(r"^ *(`{3,})(.*)\n(?:.*\n)*?^ *\1 *$", re.MULTILINE)


def on_page(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.filterwarnings("always::softreach.support.errors.SoftreachWarning")
@pytest.mark.parametrize("page", PAGES, ids=on_page)
def test_everything_on_a_page_runs_and_prints_what_it_says(page, tmp_path, monkeypatch, request):
    pytest.importorskip("matplotlib.pyplot")
    if page.stem == "models":
        pytest.importorskip("mujoco")
        pytest.importorskip("elastica")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    known = {*sys.modules}
    parsers = [
        CodeBlockParser("python", run_python),
        CodeBlockParser("bash", run_commands),
        CodeBlockParser("toml", read_design),
        CodeBlockParser("text", compare_output),
    ]
    document = Document.parse(str(page), *parsers, encoding="utf-8")
    document.namespace["__name__"] = "__documentation__"
    document.namespace["_all"] = request.config.option.markexpr != "not large"
    for example in document.examples():
        example.evaluate()
    for name in {*sys.modules} - known:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.filterwarnings("always::softreach.support.errors.SoftreachWarning")
@pytest.mark.parametrize(
    "notebook",
    [  # what the others do is on pages too
        pytest.param(path, marks=[] if path.stem == "paper" else [pytest.mark.large])
        for path in NOTEBOOKS
    ],
    ids=on_page,
)
def test_every_notebook_runs_and_is_stored_without_outputs(notebook, tmp_path, monkeypatch):
    """As Jupyter runs it: in one namespace, and what a cell ends with is shown."""
    monkeypatch.chdir(tmp_path)
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    namespace = {"__name__": "__notebook__"}
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            *statements, last = ast.parse("".join(cell["source"])).body
            exec(compile(ast.Module(statements, []), notebook.name, "exec"), namespace)
            mode = "eval" if isinstance(last, ast.Expr) else "exec"
            tree = ast.Expression(last.value) if mode == "eval" else ast.Module([last], [])
            shown = eval(compile(tree, notebook.name, mode), namespace)
            for name in ("_repr_html_", "_repr_png_"):
                getattr(shown, name, str)()


@pytest.mark.parametrize("page", PAGES, ids=on_page)
def test_fences_are_declared_pictures_exist_and_rows_of_tables_have_a_cell_for_each_head(page):
    heads, text = 0, page.read_text(encoding="utf-8")
    languages = {match[2].strip() for match in FENCE.finditer(text)}
    assert languages <= {"python", "bash", "toml", "text", "bibtex", "julia", "c"}
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        assert picture.startswith(address()) or (page.parent / picture).is_file(), picture
    for line in re.sub(r"(?ms)^```.*?^```", "", text).splitlines():
        cells = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        assert not heads or not cells or cells == heads, line
        heads = cells


def test_every_figure_has_words():
    pictures = (ROOT / "docs" / "pictures.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`plot_.+?`) \|", pictures, re.MULTILINE)
    described = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert {name for name in sr.plot.__all__ if name.startswith("plot_")} <= described


def test_the_navigation_and_the_pages_are_the_same():
    named = re.findall(r"(?m)(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    pages = (ROOT / "docs").rglob("*.md")
    assert sorted(named) == sorted(page.relative_to(ROOT / "docs").as_posix() for page in pages)


def test_files_that_the_design_names_are_there():
    pages = ROOT / "DESIGN.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "design").glob("*.md"))
    text = "".join(page.read_text("utf-8") for page in pages)
    named = re.findall(r"`([a-z_]+/[\w/]*)(?:\.py)?`", text)
    folders = [ROOT, *(path for path in (ROOT / "src").rglob("*") if path.is_dir())]
    assert len(named) > 100
    for name in {name.rstrip("/") for name in named}:
        places = (folder / f"{name}{end}" for folder in folders for end in ("", ".py"))
        assert any(place.exists() for place in places), name


def test_the_readme_is_short_and_its_links_hold_on_a_package_index():
    """They are absolute, begin with the address of pyproject.toml, and lead to what exists."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) < 200
    links = re.findall(r"\]\(([^)]+)\)", readme)
    own = [link.removeprefix(address()) for link in links if link.startswith(address())]
    assert len(own) > 10
    assert all(link.startswith("https://") for link in links)
    for link in own:
        assert (ROOT / re.sub(r"^/(blob|raw)/main/|#.*", "", link)).exists(), link


def test_another_address_is_written_wherever_the_present_one_stands():
    files = (path for path in ROOT.glob("*") if path.is_file())
    hosts = (path for path in files if address() in path.read_text("utf-8", errors="ignore"))
    assert {path.name for path in hosts} == {*SPELLED_OUT}


@pytest.mark.parametrize("picture", sorted((ROOT / "docs").rglob("*.png")), ids=on_page)
def test_pictures_stay_small(picture):
    assert picture.stat().st_size < 400_000


def is_left_out(example):
    """Whether a fence takes too long for the usual run; what follows it is not compared then."""
    left_out = example.parsed.startswith(LONG) and not example.namespace["_all"]
    if left_out:
        example.namespace["_printed"] = LONG
    return left_out


def run_python(example):
    if is_left_out(example):
        return
    named = FILE.match(example.parsed)
    if named:
        Path(named[1]).write_text(example.parsed, encoding="utf-8")
    if named or NOT_EXECUTED.match(example.parsed):
        example.namespace["_printed"] = None
        return
    if not is_compared(example):
        source = example.parsed
        few = re.sub(r"\bn=\d{2,3}_000\b", f"n={FEW}", source)
        example.parsed = Lexeme(few, source.offset, source.line_offset)
    with printed_into(example):
        PythonEvaluator()(example)


def is_compared(example):  # with the text fence after it
    return example.document.text[example.region.end :].lstrip().startswith("```text")


def run_commands(example):
    if is_left_out(example):
        return
    small = not is_compared(example)
    with printed_into(example):
        for line in example.parsed.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words[:2] == ["softreach", "studio"] and "--static" not in words:
                serve_and_end(words[1:])
            elif words and words[0] == "softreach":
                told = re.search(r"# exit code ([12])$", line.rstrip())
                expected = int(told[1]) if told else 0
                assert run(_few(words[1:]) if small else words[1:]) == expected, line
            else:
                assert not words or words[0] in SETUP, f"neither softreach nor set-up: {line}"


def serve_and_end(arguments):
    """Start the studio as a person does, and end it once it says where its page is."""
    command = [sys.executable, "-m", "softreach", *arguments, "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as studio:
        line = studio.stdout.readline()
        studio.terminate()
    assert line.startswith("http://127.0.0.1:"), line
    assert studio.returncode == 128 + signal.SIGTERM


def _few(arguments):
    """The same command with few samples."""
    if arguments[0] not in ("demo", "cloud"):
        return arguments
    if "--n" in arguments:
        at = arguments.index("--n")
        arguments = arguments[:at] + arguments[at + 2 :]
    return [*arguments, "--n", str(FEW)]


def read_design(example):
    """Read a fence as a file, and keep it for the commands that follow."""
    needs = "[[reach]]" in example.parsed or "[search]" in example.parsed
    (sr.Requirements if needs else sr.Manipulator).from_toml(example.parsed)
    Path("needs.toml" if needs else "trunk.toml").write_text(example.parsed, encoding="utf-8")
    example.namespace["_printed"] = None


def compare_output(example):
    printed = example.namespace.pop("_printed", None)
    assert printed is not None, f"line {example.line}: no executed fence before this output"
    if printed == LONG:
        return
    # Compilation is announced on the first run only, progress on slow machines only.
    passing = ("softreach: compiling", "so far")
    lines = (line for line in printed.splitlines() if not line.startswith(passing))
    found = [line for line in lines if not line.endswith(passing)]
    wanted = example.parsed.splitlines()
    assert len(found) == len(wanted), f"line {example.line}: printed {found}"
    for one, other in zip(wanted, found, strict=True):
        assert same_line(one, other), f"line {example.line}: {one!r} says the page, not {other!r}"


def same_line(wanted, found):
    head, cut, _ = wanted.partition("...")
    want, have = _words(head), _words(found)
    enough = len(have) >= len(want) if cut else len(have) == len(want)
    return enough and all(map(_same, want, have))


def _words(line):
    return re.findall(r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?|[^\s\d]+|\d", line)


def _same(wanted, found):
    try:
        one, other = float(wanted.replace(",", "")), float(found.replace(",", ""))
    except ValueError:
        return wanted == found
    return math.isclose(one, other, rel_tol=1e-3, abs_tol=1e-9)


@contextmanager
def printed_into(example):
    """Keep standard output and error of the block for a text fence after it."""
    text = io.StringIO()
    with redirect_stdout(text), redirect_stderr(text):
        yield
    example.namespace["_printed"] = text.getvalue()


# What the code cites, `theory (7)`, `theory (21) and (22)` or `[Blanes2000]`, can be looked up

NAMES = ("theory.md", "theory-loads.md", "references.md")
*SECTIONS, REFERENCES = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in NAMES)
THEORY = "".join(SECTIONS)
EQUATIONS = r"[Tt]heory\s+(\(\d+\)(?:(?:,| and| to)\s+\(\d+\))*)"
KEY = r"\[([A-Z][A-Za-z]+(?:19|20)\d\d)\]"


def texts():
    for folder in ("src", "docs", "design", "tests", "benchmarks"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".md") and path != Path(__file__):
                # a citation may be broken over two lines of a comment
                yield path, re.sub(r"\n\s*#? ?", " ", path.read_text(encoding="utf-8"))


def test_every_equation_has_a_number_of_its_own():
    numbers = re.findall(r"\\tag\{(\d+)\}", THEORY)
    assert len(numbers) == len(set(numbers))
    assert THEORY.count("\n$$\n") == 2 * len(numbers)


def test_what_is_cited_is_in_the_theory_or_the_references():
    equations = set(re.findall(r"\\tag\{(\d+)\}", THEORY))
    literature = set(re.findall(r"^### (\w+)$", REFERENCES, re.MULTILINE))
    for known, cites, part, citing in (
        (equations, EQUATIONS, r"\d+", {"magnus.py", "dexterity.py"}),
        (literature, KEY, r"\w+", {"theory.md", "magnus.py"}),
    ):
        cited = {
            (path.name, one)
            for path, text in texts()
            for group in re.findall(cites, text)
            for one in re.findall(part, group)
        }
        assert {name for name, _ in cited} >= citing
        assert [entry for entry in sorted(cited) if entry[1] not in known] == []
