"""Measure the names of the code: what functions, locals, classes and constants are called.

usage: python tests/naming.py

Prints the figures of names for the package and for everything around it; then those of the
documentation's language.
"""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np

import prose
from test_architecture import MODULES, list_imported_modules

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src/hiproof"
AROUND = ("tests", "benchmarks", "experiments", "docs", "examples", "qgis", "release")
COLUMNS = 100  # of a line of code

FUNCTION_WORDS = frozenset(
    re.findall(
        r"\w+",
        """own told asked held known left low high found others here there where what which
        that who whom when why how kept seen shown said says given taken made done gone put
        beside besides before after near far away apart aside alone around about above below
        beyond behind over under between into within without through towards off up down on
        at for from like likely unlike one two three both either neither each every all any
        some several few fewer fewest many more most much less least enough better same such
        else otherwise again anew yet still now then once ever never always often already
        also too very so as is are was were be been has have had may might must can could
        will would shall should not no nor and or but if while until since because than
        whether wanted needed used chosen tried drawn named called fresh rest mine ours its
        their of""",
    )
)
"""Words that name no thing. Names of sides (`left` beside `right`) do not count."""

IRREGULAR = frozenset(
    re.findall(
        r"\w+",
        """told held known kept seen shown said given taken made done gone found left drawn
        grown chosen written sought brought bent bound built dealt felt lost meant met sent
        spent stood taught thrown worn wound broken fallen frozen hidden ridden risen shaken
        spoken stolen woken""",
    )
)
VERBS_IN_ED = frozenset({"embed", "exceed", "feed", "need", "proceed", "seed", "shed", "speed"})
VERBS = frozenset(
    re.findall(
        r"\w+",
        """accept are begin build check choose compose compute count describe end
        estimate explain find fit fits format has have import is iterate judge knows
        lies list log make mark measure minimise model names open plan put raise read refuse
        remark remove report round run score search select serve solve sort split step
        take turn vote warn work write""",
    )
)
"""First words of names that may end in any word: `warn_if_moved`, `is_registered`."""

ALLOWED_FUNCTIONS = frozenset({"of", "around", "at", "near", "compiled", "joined"})
"""Constructors and look-ups (`Scores.of`, `LocalFrame.around`), the decorator of compiled code."""

ALLOWED_CONSTANTS = frozenset({"PRIMITIVE"})  # each shape's file defines its own


def list_files() -> list[Path]:
    """Return the package's source files."""
    return sorted(PACKAGE.rglob("*.py"))


def list_files_around() -> list[Path]:
    """Return the Python files of tests, benchmarks, experiments, examples and the plugin."""
    return [file for folder in AROUND for file in sorted((ROOT / folder).rglob("*.py"))]


def name_file(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def parse(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def iterate_statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and all statements below it, however deep.

    Expressions, most of a tree, hold no statements and are passed over.
    """
    yield node
    for field in ("body", "handlers", "cases", "orelse", "finalbody"):
        inner = getattr(node, field, ())
        for statement in inner if isinstance(inner, list) else ():
            yield from iterate_statements(statement)


@dataclass(frozen=True)
class FileNames:
    """The names of a file: of functions with their locals, of classes, of constants with values."""

    functions: tuple[tuple[str, frozenset[str]], ...]
    classes: tuple[str, ...]
    constants: tuple[tuple[str, str], ...]


@cache
def read_names(file: Path) -> FileNames:
    """Return the names of a file, without those of properties, which are nouns."""
    tree = parse(file)
    statements = list(iterate_statements(tree))
    functions = (node for node in statements if isinstance(node, ast.FunctionDef))
    return FileNames(
        tuple((node.name, list_locals(node)) for node in functions if not is_property(node)),
        tuple(node.name for node in statements if isinstance(node, ast.ClassDef)),
        tuple(iterate_constants(tree)),
    )


def is_property(function: ast.FunctionDef) -> bool:
    return any("property" in ast.unparse(item) for item in function.decorator_list)


def is_participle(word: str) -> bool:
    """Whether a word is a past participle and no verb's base form.

    >>> [is_participle(word) for word in ("united", "drawn", "embed", "merge")]
    [True, True, False, False]
    """
    return word in IRREGULAR or (word.endswith("ed") and word not in VERBS_IN_ED)


def find_misnamed_functions(files: list[Path]) -> list[str]:
    """Return functions whose names end in a participle or a function word.

    Tests are named by the law that they check, which is a sentence.
    """
    misnamed = []
    functions = ((file, name) for file in files for name, _ in read_names(file).functions)
    for file, name in functions:
        words = name.strip("_").split("_")
        first, last = words[0], words[-1]
        if name in ALLOWED_FUNCTIONS or first in VERBS | {"test"}:
            continue
        if is_participle(last) or last in FUNCTION_WORDS - {"at"}:  # `height_at` is a height
            misnamed.append(f"{name_file(file)}: {name}")
    return sorted(set(misnamed))


def list_locals(function: ast.FunctionDef) -> frozenset[str]:
    """Return the names of a function's parameters and variables."""
    arguments = function.args
    names = {item.arg for item in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)}
    stores = (node for node in ast.walk(function) if isinstance(node, ast.Name))
    names |= {node.id for node in stores if isinstance(node.ctx, ast.Store)}
    return frozenset(names - ({"left"} if "right" in names else set()))


def count_locals(files: list[Path]) -> tuple[int, Counter[str]]:
    """Return the number of local names, and how often each function word is one of them."""
    functions = (function for file in files for function in read_names(file).functions)
    names = [name for _, local_names in functions for name in local_names]
    return len(names), Counter(name for name in names if name in FUNCTION_WORDS)


def find_duplicate_classes(files: list[Path]) -> dict[str, list[str]]:
    """Return the names that several classes have, with their files."""
    places = defaultdict(list)
    for file in files:
        for name in read_names(file).classes:
            places[name].append(name_file(file))
    return {name: files for name, files in places.items() if len(files) > 1}


def iterate_constants(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield the constants at the top of a file with their values as text."""
    for node in tree.body:
        if isinstance(node, ast.AnnAssign):
            targets: list[ast.expr] = [node.target] if node.value else []
        else:
            targets = node.targets if isinstance(node, ast.Assign) else []
        for target in targets:
            pairs = [(target, node.value)]  # type: ignore[attr-defined]
            if isinstance(target, ast.Tuple):
                values = getattr(node.value, "elts", ())  # type: ignore[attr-defined]
                pairs = list(zip(target.elts, values, strict=False))
            for name, value in pairs:
                if isinstance(name, ast.Name) and re.fullmatch(r"[A-Z][A-Z0-9_]+", name.id):
                    yield name.id, ast.unparse(value)


def find_ambiguous_constants(files: list[Path]) -> list[str]:
    """Return the names that constants with different values share."""
    values = defaultdict(set)
    for file in files:
        for name, value in read_names(file).constants:
            values[name].add(value)
    return sorted(
        name for name in values if len(values[name]) > 1 and name not in ALLOWED_CONSTANTS
    )


def find_long_lines(files: list[Path]) -> list[str]:
    """Return the lines of code over 100 columns, as file:line."""
    lines = []
    for file in files:
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            if len(line) > COLUMNS and len(line.split()) > 1 and "noqa" not in line:
                lines.append(f"{name_file(file)}:{number}")
    return lines


def count_import_cycles() -> int:
    """Return the number of circles of the package's modules that import each other."""
    graph = {module: list_imported_modules(module) - {()} for module in MODULES if module}
    cycles = 0
    while True:
        try:
            TopologicalSorter(graph).prepare()
            return cycles
        except CycleError as error:
            cycles += 1
            circle = error.args[1]
            graph = {module: graph[module] - set(circle) for module in graph}


def count_deep_imports() -> Counter[str]:
    """Return how many lines of each test import from modules within a package of hiproof."""
    pattern = re.compile(r"^\s*from hiproof\.\w+\.[\w.]+ import|^\s*import hiproof\.\w+\.\w+")
    counts: Counter[str] = Counter()
    for file in sorted((ROOT / "tests").rglob("*.py")):
        lines = file.read_text(encoding="utf-8").splitlines()
        counts[file.name] = sum(bool(pattern.match(line)) for line in lines)
    return counts


def print_names(title: str, files: list[Path]) -> None:
    """Print the figures of some files' names."""
    total, words = count_locals(files)
    share = 100 * words.total() / total
    print(title)
    print(f"  misnamed functions: {len(find_misnamed_functions(files))}")
    print(f"  locals that are function words: {words.total()} of {total} ({share:.1f} %)")
    print(f"  duplicate class names: {len(find_duplicate_classes(files))}")
    print(f"  constants of one name with several values: {len(find_ambiguous_constants(files))}")
    print(f"  lines over {COLUMNS} columns: {len(find_long_lines(files))}")


def print_language() -> None:
    """Print the figures of the pages' sentences, of import cycles and of imports in tests."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    counts = prose.count_words(readme)
    print(
        f"README: {len(readme.split())} words; words a sentence: {counts.mean():.1f} in the mean, "
        f"{np.percentile(counts, 90):.0f} at p90"
    )
    pages = [page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs").glob("*.md"))]
    counts = np.concatenate([prose.count_words(page) for page in pages])
    print(f"docs: {np.percentile(counts, 90):.0f} words a sentence at p90")
    long = sum(len(prose.find_long_lines(page.read_text(encoding="utf-8"))) for page in prose.PAGES)
    print(f"lines of pages over {COLUMNS} columns, outside tables: {long}")
    print(f"import cycles: {count_import_cycles()}")
    deep = count_deep_imports()
    union = sum(number for name, number in deep.items() if name.startswith("test_union"))
    print(f"lines of tests that import within packages: {deep.total()}, of fit/union's {union}")


def main() -> None:
    print_names("package", list_files())
    print_names("tests, benchmarks, experiments, examples and plugin", list_files_around())
    print_language()


if __name__ == "__main__":
    main()
