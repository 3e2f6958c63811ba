"""What the code cites can be looked up: equations in the theory, literature in the references.

`theory (7)` or `theory (21) and (22)` cites equations, `[Blanes2000]` literature.
"""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
THEORY = "".join(
    (ROOT / "docs" / page).read_text(encoding="utf-8") for page in ("theory.md", "theory-loads.md")
)
REFERENCES = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
EQUATIONS = r"[Tt]heory\s+(\(\d+\)(?:(?:,| and| to)\s+\(\d+\))*)"
KEY = r"\[([A-Z][A-Za-z]+(?:19|20)\d\d)\]"


def texts() -> Iterator[tuple[Path, str]]:
    for folder in ("src", "docs", "design", "tests", "benchmarks"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".md") and path != Path(__file__):
                # a citation may be broken over two lines of a comment
                yield path, re.sub(r"\n\s*#? ?", " ", path.read_text(encoding="utf-8"))


def test_every_equation_has_a_number_of_its_own():
    numbers = re.findall(r"\\tag\{(\d+)\}", THEORY)
    assert len(numbers) == len(set(numbers))
    assert THEORY.count("\n$$\n") == 2 * len(numbers)


def test_every_equation_that_is_cited_is_in_the_theory():
    known = set(re.findall(r"\\tag\{(\d+)\}", THEORY))
    cited = {
        (path.name, number)
        for path, text in texts()
        for group in re.findall(EQUATIONS, text)
        for number in re.findall(r"\d+", group)
    }
    assert {name for name, _ in cited} >= {"magnus.py", "dexterity.py"}
    assert [entry for entry in sorted(cited) if entry[1] not in known] == []


def test_all_literature_that_is_cited_is_in_the_references():
    known = set(re.findall(r"^### (\w+)$", REFERENCES, re.MULTILINE))
    cited = {(path.name, key) for path, text in texts() for key in re.findall(KEY, text)}
    assert {name for name, _ in cited} >= {"theory.md", "magnus.py"}
    assert [entry for entry in sorted(cited) if entry[1] not in known] == []
