"""Laws of compiled code: it is what all its sources say, it is kept, and where it cannot be kept
that is said once.
"""

import ast
import errno
import importlib
import os
import pickle
import platform
import re
import sys
import tempfile
import warnings
from pathlib import Path

import numba
import pytest

import hiproof
from hiproof.city.work import warm
from hiproof.compiled import kept, news, stamp
from hiproof.errors import NotKeptWarning
from programs import run_python

PACKAGE = Path(hiproof.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
OUTER = """
from hiproof.compiled import compiled
from .middle import doubled

@compiled
def answer(x):
    return doubled(x) + 1
"""
MIDDLE = """
from hiproof.compiled import compiled
from . import inner

@compiled
def doubled(x):
    return inner.number(x) * 2
"""
INNER = """
from hiproof.compiled import compiled

@compiled
def number(x):
    return x * {factor}
"""


def make_sources(factor):
    """A package of three compiled functions, each calling the next; only the innermost knows
    `factor`.
    """
    return {
        "town/__init__.py": "",
        "town/outer.py": OUTER,
        "town/middle.py": MIDDLE,
        "town/inner.py": INNER.format(factor=factor),
    }


@pytest.fixture
def town(tmp_path, monkeypatch):
    """A folder with the package, which is forgotten again afterwards."""
    for name, text in make_sources(3).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    # Python knows a source by its length and second, and tests change a digit sooner
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    yield tmp_path
    forget()


def forget():
    """Be as a new process to the package."""
    for name in [name for name in sys.modules if name.split(".")[0] == "town"]:
        del sys.modules[name]
    for cached in (
        stamp.compute_stamp,
        stamp.list_imports,
        stamp.find_sources,
        stamp.compiled_files,
        stamp.digest_file,
        kept.place_to_write,
        kept.warn_not_kept,
    ):
        cached.cache_clear()
    kept.remove_outdated.cache_clear()


def is_loaded(function):
    """Whether all code of a function was loaded rather than compiled."""
    return all(result.metadata is None for result in function.overloads.values())


def ask():
    """(the answer, whether its code was loaded rather than compiled, how often it was said that it
    cannot be kept).
    """
    forget()
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        answer = importlib.import_module("town.outer").answer
        got = answer(10)
    return got, is_loaded(answer), len([w for w in remarks if w.category is NotKeptWarning])


def files_in(folder):
    return sorted(path.name for path in folder.rglob("*.nbc"))


PAIRS = """
from collections import namedtuple
from hiproof.compiled import compiled

Pair = namedtuple("Pair", "first second")

@compiled
def swapped(pair):
    if len(pair.first) == 0:
        raise ValueError("expected a number")
    return Pair(pair.second, pair.first)

@compiled
def swapped_twice(pair):
    return swapped(swapped(pair))
"""
ASK_PAIRS = """
import numpy as np
from town.pairs import Pair, swapped, swapped_twice
zero, one, none = np.zeros(2), np.ones(1, bool), np.zeros(0)
twice = swapped_twice(Pair(zero, one))
print(twice.first, twice.second)
"""
ASK_PAIRS_MORE = """
print(swapped(Pair(zero, one)))
try:
    swapped(Pair(none, one))
except ValueError as error:
    print(error)
"""


def test_kept_code_is_loaded_by_the_next_process(town):
    assert ask() == (61, False, 0)
    names = ["inner.number", "middle.doubled", "outer.answer"]
    assert [name.split("-")[0] for name in files_in(town)] == [*names, "outer.answer"]
    assert [name.split("-")[0] for name in files_in(town) if "-python." in name] == ["outer.answer"]
    assert ask() == (61, True, 0)


def test_a_function_that_compiled_code_called_is_called_by_python_as_well(town):
    """Its wrapper is compiled when it is wanted, kept, and loaded by the next process."""
    ask()
    imports = "from test_compiled import is_loaded; from town.inner import number; "
    inner_code = imports + "print(number(10), is_loaded(number))"
    for _ in range(2):
        assert run(town, inner_code).split() == ["30", "True"]
        assert [name.split("-")[0] for name in files_in(town) if "-python." in name] == [
            "inner.number",
            "outer.answer",
        ]
    both_code = "from town.inner import number; from town.outer import answer; "
    printed = run(town, both_code + "print(answer(10), number(10), number(10))")
    assert printed.split() == ["61", "30", "30"]


def test_python_gives_an_address_of_a_tuple_and_keeps_its_arrays(town):
    """No call leaves a reference behind, and an array that comes back is the one that was given."""
    (town / "town" / "pairs.py").write_text(PAIRS)
    script = """
import sys
import numpy as np
from town.pairs import Pair, swapped
pair = Pair(np.arange(3.0), np.ones(2, bool))
before = sys.getrefcount(pair.first)
for _ in range(3):
    assert swapped(pair).second is pair.first
try:
    swapped(Pair(pair.first[:0], pair.second))
except ValueError:
    print(sys.getrefcount(pair.first) - before, pair.first)
"""
    assert run(town, script) == "0 [0. 1. 2.]\n"


def test_a_wrapper_made_for_loaded_code_carries_arrays_tuples_and_errors(town):
    (town / "town" / "pairs.py").write_text(PAIRS)
    assert run(town, ASK_PAIRS) == "[0. 0.] [ True]\n"
    for _ in range(2):
        pair = "Pair(first=array([ True]), second=array([0., 0.]))"
        assert run(town, ASK_PAIRS + ASK_PAIRS_MORE).splitlines()[1:] == [pair, "expected a number"]


@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="names a kind of x86-64 processors"
)
def test_code_for_a_kind_of_processors_is_loaded_on_each_of_them(town, monkeypatch):
    """An image is made on one machine and run on others."""
    monkeypatch.setenv("NUMBA_CPU_NAME", "x86-64-v3")
    monkeypatch.setenv("NUMBA_CPU_FEATURES", "")
    script = """
import llvmlite.binding
llvmlite.binding.get_host_cpu_name = lambda: {host!r}
from pathlib import Path
from hiproof.city.work import warm
from hiproof.compiled import kept
from test_compiled import is_loaded
from town.outer import answer
times = []
kept.list_folders = lambda sources: (Path({folder!r}),)
warm.compile_halves = lambda: not times.append(1)
warm.make_ready()
print(len(times), answer(10), is_loaded(answer))
"""
    first_host, second_host = (
        run(town, script.format(host=host, folder=str(town / "marks"))).split()
        for host in ("here", "there")
    )
    assert first_host == ["1", "61", "False"] and second_host == ["0", "61", "True"]


def test_a_changed_line_makes_what_stands_on_it_new_and_removes_the_old(town):
    ask()
    unchanged = files_in(town)[0]
    (town / "town" / "middle.py").write_text(MIDDLE.replace("* 2", "* 4"))
    assert ask() == (121, False, 0)
    assert len(files_in(town)) == 4 and files_in(town)[0] == unchanged


def run(packages, code):
    """The output of code that finds this hiproof and what is in `packages`."""
    places = packages, PACKAGE.parent, Path(__file__).parent
    return run_python(code, PYTHONPATH=os.pathsep.join(map(str, places)))


@pytest.mark.parametrize(
    "damage",
    [lambda whole: whole[:100], lambda whole: b"\x8c\x02\xff\xff" + whole],
    ids=["cut off", "no text"],
)
def test_a_damaged_file_is_compiled_again(town, damage):
    ask()
    for path in town.rglob("outer.*.nbc"):
        path.write_bytes(damage(path.read_bytes()))
    assert ask() == (61, False, 0)
    assert ask() == (61, True, 0)


def test_where_nothing_can_be_kept_every_process_compiles_and_says_so_once(town, monkeypatch):
    (town / "town" / "__pycache__").write_text("a file where the folder would be")
    (town / "home").write_text("and no home")
    assert ask() == (61, False, 1)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(town / "elsewhere"))
    assert ask() == (61, False, 0)
    assert ask() == (61, True, 0)


def test_a_full_disk_costs_time_only(town, monkeypatch):
    def full(path, data):
        path.touch()
        raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    assert ask() == (61, False, 1)
    assert not list(town.rglob("*.nbc*"))


def test_code_kept_in_an_install_that_became_read_only_is_loaded(town, monkeypatch):
    ask()

    def refuse(**where):
        raise PermissionError

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    assert ask() == (61, True, 0)


def outside_functions(node):
    """The node and all below it that run when the module is imported."""
    yield node
    for inner in ast.iter_child_nodes(node):
        typing_alone = isinstance(inner, ast.If) and ast.unparse(inner.test) == "TYPE_CHECKING"
        if not typing_alone and not isinstance(inner, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield from outside_functions(inner)


def list_parsed_imports(source):
    """The package's files that a source imports, by Python's own parser: all but those inside
    functions and for types alone.
    """
    results = set()
    for node in outside_functions(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom):
            start = source.parents[node.level - 1] if node.level else PACKAGE.parent
            base = start.joinpath(*(node.module or "").split("."))
            modules = [base, *(base / alias.name for alias in node.names)]
        elif isinstance(node, ast.Import):
            modules = [PACKAGE.parent.joinpath(*alias.name.split(".")) for alias in node.names]
        else:
            continue
        results |= {
            file for module in modules for file in (Path(f"{module}.py"), module / "__init__.py")
        }
    return {file for file in results if file.is_file() and file.is_relative_to(PACKAGE)}


def test_the_stamp_follows_every_import_at_the_top():
    """The regular expression finds what the parser does."""
    missing = {
        source: list_parsed_imports(source) - stamp.list_imports(source) for source in SOURCES
    }
    assert {source: files for source, files in missing.items() if files} == {}
    assert len(missing) > 300


def test_a_stamp_does_not_change_with_what_is_imported_inside_functions(tmp_path):
    (tmp_path / "__init__.py").touch()
    for name, text in (("late", ""), ("user", "def ask():\n    from . import late\n")):
        (tmp_path / f"{name}.py").write_text(text)
    assert tmp_path / "late.py" not in stamp.closure(tmp_path / "user.py")


@pytest.mark.parametrize("name", ["__init__", "dispatcher"])
def test_every_stamp_stands_on_how_code_is_compiled(tmp_path, name):
    (tmp_path / "alone.py").write_text("import math\n")
    assert stamp.HERE / f"{name}.py" in stamp.closure(tmp_path / "alone.py")


def test_a_stamp_changes_with_any_source_it_stands_on_and_with_no_other(town, monkeypatch):
    files = {name: town / "town" / f"{name}.py" for name in ("outer", "middle", "inner")}

    def compute_stamps():
        forget()
        return {name: stamp.compute_stamp(file) for name, file in files.items()}

    old = compute_stamps()
    files["middle"].write_text(MIDDLE + "\n# a word more\n")
    new = compute_stamps()
    assert new["inner"] == old["inner"]
    assert new["middle"] != old["middle"] and new["outer"] != old["outer"]
    monkeypatch.setattr(numba, "__version__", "another")
    assert not set(compute_stamps().values()) & set(new.values())


@pytest.fixture
def compiled_beforehand(tmp_path, monkeypatch):
    """The names of functions of each time that all is compiled beforehand, as if it were."""
    times = []

    def compile_halves():
        times.append({f"functions.of_{len(times)}"})
        news.ready.update(times[-1])
        return True

    monkeypatch.setattr(warm, "compile_halves", compile_halves)
    monkeypatch.setattr(kept, "list_folders", lambda sources: (tmp_path / "kept",))
    monkeypatch.setattr(news, "ready", set())
    kept.remove_outdated.cache_clear()
    kept.warn_not_kept.cache_clear()
    return times


def test_what_runs_call_is_compiled_once_and_again_after_a_change(
    tmp_path, compiled_beforehand, monkeypatch
):
    for stamped, times in (("a", 1), ("a", 1), ("b", 2), ("b", 2)):
        monkeypatch.setattr(warm, "compute_common_stamp", lambda stamped=stamped: stamped)
        warm.make_ready()
        assert len(compiled_beforehand) == times
    assert len(files_in(tmp_path)) == 1


def test_a_mark_that_cannot_be_kept_or_read_ends_no_run(tmp_path, compiled_beforehand, monkeypatch):
    def full(path, data):
        path.touch()
        raise OSError(errno.ENOSPC, "no space left on device")

    with monkeypatch.context() as patch, pytest.warns(NotKeptWarning):
        patch.setattr(Path, "write_bytes", full)
        warm.make_ready()
    assert files_in(tmp_path) == []
    warm.make_ready()
    (mark,) = tmp_path.rglob("*.nbc")
    mark.write_bytes(b"\xff\xfe damaged")
    warm.make_ready()
    assert len(compiled_beforehand) == 3


def test_functions_compiled_before_are_not_announced_again(compiled_beforehand):
    warm.make_ready()
    news.ready.clear()  # another process, later
    warm.make_ready()
    assert [news.ready] == compiled_beforehand


def test_where_nothing_can_be_kept_nothing_is_compiled_beforehand(
    tmp_path, compiled_beforehand, monkeypatch
):
    (tmp_path / "file").touch()
    monkeypatch.setattr(kept, "list_folders", lambda sources: (tmp_path / "file" / "folder",))
    with pytest.warns(NotKeptWarning, match="NUMBA_CACHE_DIR"):
        warm.make_ready()
    assert compiled_beforehand == []


def test_what_failed_beforehand_is_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "list_folders", lambda sources: (tmp_path,))
    monkeypatch.setattr(warm, "__name__", "no.such.module")
    for _ in range(2):
        warm.make_ready()
        assert files_in(tmp_path) == []


def test_where_no_process_can_be_started_nothing_is_compiled_beforehand(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "list_folders", lambda sources: (tmp_path,))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nowhere"))
    warm.make_ready()
    assert files_in(tmp_path) == []


LONG = """
from hiproof.compiled import compiled

@compiled
def number(x, power):
    total = 0.0
    for k in range(power):
        for m in range(k):
            total += (x + k) ** m / (x - m) + (x * m) % (k + 1.5)
            if total > 1e9:
                total -= {factor} * x / (k + m + 0.5)
    return total
"""
CALLER = """
from hiproof.compiled import compiled
from .inner import number

@compiled
def answer(x):
    total = number(x, 1)
    for k in range(2, 5):
        total += number(x, k)
    return total
"""


def test_a_large_function_is_called_and_not_copied(town):
    def answers():
        forget()
        answer = importlib.import_module("town.outer").answer
        return answer(10.5), answer.py_func(10.5)

    folder, inner = town / "town", town / "town" / "inner.py"
    (folder / "outer.py").write_text(CALLER)
    # the second time the old code is still in this process, under another symbol
    for factor in (3, 4):
        inner.write_text(LONG.replace("1e9", "1.0").format(factor=factor))
        fast, slow = answers()
        assert fast == pytest.approx(slow, rel=1e-12)
    codes = [path for path in sorted(folder.rglob("*.nbc")) if "-python." not in path.name]
    first, other = (pickle.loads(path.read_bytes()) for path in codes)
    (_, first_is_large, *_), (_, _, callees, _) = first, other
    assert first_is_large and [callee.name for callee in callees] == ["number"]
    kept_files = files_in(town)
    printed = run(town, "from town.outer import answer; print(answer(10.5))")
    assert float(printed) == fast
    assert files_in(town) == kept_files, "a new process loads the function that another calls"


NEWCOMER = """
from hiproof.compiled import compiled
from .outer import answer

@compiled
def call(x):
    return answer(x) + 0.5
"""


@pytest.mark.parametrize("inner", [INNER, LONG], ids=["copied", "called"])
def test_what_was_loaded_is_compiled_against(town, inner):
    """What a caller would copy of it is read when there is one that is new."""
    (town / "town" / "inner.py").write_text(inner.format(factor=3))
    if inner is LONG:
        (town / "town" / "outer.py").write_text(CALLER)
    forget()
    first = importlib.import_module("town.outer").answer(10.5)
    (town / "town" / "newcomer.py").write_text(NEWCOMER)
    forget()
    call = importlib.import_module("town.newcomer").call
    answer = sys.modules["town.outer"].answer
    assert answer(10.5) == first and is_loaded(answer)
    assert call(10.5) == first + 0.5 and not is_loaded(call)


LIBRARY = """
import numpy as np
from hiproof.compiled import compiled

@compiled
def answer(x):
    return np.{function}(x)
"""


def test_code_of_two_processes_meets_in_a_third_without_mistaking_one_for_the_other(town):
    """numba's nanmin and nanmax are made of functions of the same names and types."""
    ask = "import numpy as np; from town.{0} import answer; print(answer(np.arange(50.0)))"
    functions = ("nanmin", "nanmax")
    for function in functions:
        (town / "town" / f"{function}.py").write_text(LIBRARY.format(function=function))
    single_answers = [run(town, ask.format(function)) for function in functions]
    files = [path for path in town.rglob("*.nbc") if "-python." not in path.name]
    numbers = [set(re.findall(rb"_ZN5numba\w*?B\d+v(\d+)B", path.read_bytes())) for path in files]
    assert len(numbers) == 2 and all(numbers) and not numbers[0] & numbers[1]
    assert run(town, "\n".join(map(ask.format, functions))) == "".join(single_answers)


def test_constants_in_a_call_compile_nothing_apart(town):
    (town / "town" / "inner.py").write_text(LONG.format(factor=3))
    (town / "town" / "outer.py").write_text(CALLER)
    forget()
    importlib.import_module("town.outer").answer(10.5)
    assert len(sys.modules["town.inner"].number.signatures) == 1


def test_the_halves_compiled_beforehand_are_all_that_runs_call(tmp_path):
    """A function that they lack would be left to be compiled by every worker."""
    script = f"""
import sys
from pathlib import Path
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work.warm import HALVES, compile_half
from hiproof.settings import Settings
from hiproof.compiled import kept
from hiproof.simulate import demo_files

asked, read = set(), kept.Kept.read
def noted(self, part, key):
    if key:
        asked.add((self.start, str(key[0])))
    return read(self, part, key)
kept.Kept.read = noted
files = {{name: str(path) for name, path in demo_files().items()}}
with_footprints = dict(footprints=files["footprints"], terrain=files["terrain"])
few = dict(bbox=(91990, 451000, 92034, 451040))
settings = Settings().replace({{"fit": {{"parts": "one"}}}})
one = dict(footprints=files["footprints"], settings=settings, **few)
for half in HALVES:
    compile_half(half)
for given in (with_footprints, few, one):
    request = Request((files["cloud"],), Path({str(tmp_path)!r}), restart=True, **given)
    beforehand = set(asked)
    assert reconstruct_area(request).buildings > 3
    print(sorted(asked - beforehand))
"""
    assert run(tmp_path, script) == "[]\n[]\n[]\n"


@pytest.mark.parametrize("total", [1, 7, 222])
def test_the_news_of_compiling_is_a_headline_and_ten_lines_at_most(total):
    lines = []
    tell = news.Lines(lines.append)
    for n_ready in range(total):
        tell(n_ready, total)  # before a function is compiled
        tell(n_ready + 1, total)  # and after
    assert f"up to {total} functions" in lines[0]
    assert min(total, 10) <= len(lines) <= 11
    assert all(line.startswith("compiled") for line in lines[1:])


@pytest.mark.parametrize(
    "lost", ["base.BaseContext.remove_user_function", "registry.CPUDispatcher"]
)
def test_with_a_release_of_numba_that_lacks_what_keeps_code_plain_functions_run(town, lost):
    """They warn once, and give the same."""
    script = f"""
import warnings
import numba, numba.core.registry, numba.core.base
del numba.core.{lost}
with warnings.catch_warnings(record=True) as remarks:
    warnings.simplefilter("always")
    from town.outer import answer
    print(answer(10), [remark.category.__name__ for remark in remarks])
"""
    assert run(town, script) == "61 ['NotKeptWarning']\n"
    assert files_in(town) == []


def test_every_compiled_function_goes_through_one_decorator():
    jit = re.compile(r"\bn?jit\b|\bnumba\b.*\b(vectorize|cfunc|stencil)\b")
    outside = [path for path in SOURCES if path.parent.name != "compiled"]
    assert [path.name for path in outside if jit.search(path.read_text())] == []
