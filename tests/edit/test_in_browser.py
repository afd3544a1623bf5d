"""The page in a real browser, by clicks and keys: types, parts, places and what lasts of them."""

import time

import numpy as np
import pytest

import hiproof
import pages
from flat_town import make_request
from hiproof.city.plan.overrides import read_overrides
from hiproof.edit.desk import Desk
from hiproof.edit.edits import EDITS_FILE
from hiproof.edit.server import Server, Service
from pages import at_every_size, is_too_wide, list_complaints, needs_browser, project_on_canvas
from run_records import by_id

WAIT_S = 60

pytestmark = needs_browser


@pytest.fixture
def page_service(folder):
    """A service that answers, over a folder of the test's own."""
    service = Service(Desk(folder, "anna"))
    with pages.serve(Server(service)):
        yield service


@pytest.fixture
def page(browser, page_service):
    page = open_window(browser, page_service)
    yield page
    assert page.faults == []
    page.context.close()


def open_window(browser, served):
    """A window on the page, ready on its first building; its `faults` are what scripts complained
    of.
    """
    page = browser.new_context(viewport={"width": 1500, "height": 900}).new_page()
    page.set_default_timeout(60_000)
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.goto(served.address)
    wait_for_building(page, "house-")
    return page


def wait_until_true(page, expression):
    """Wait until an expression of the page, which forbids eval, as playwright's is, is true."""
    end = time.monotonic() + WAIT_S
    while not page.evaluate(expression):
        assert time.monotonic() < end, f"still not so after {WAIT_S} s: {expression}"
        page.wait_for_timeout(20)


def wait_for_building(page, title):
    """Wait until a building is there with its points."""
    wait_until_true(
        page,
        f"$('title').textContent.startsWith('{title}') && "
        "Boolean(document.querySelector('[data-figure=points]'))",
    )
    page.evaluate("() => queue")


def choose(page, id):
    page.click(f"[data-id={id}]")
    wait_for_building(page, id)


def read_figure(page, name):
    return float(page.get_attribute(f"[data-figure={name}]", "data-value"))


def press_key(page, letter):
    """Press a key, and wait until what it asks for is done."""
    page.keyboard.press(letter)
    page.evaluate("() => queue")


def test_a_wrong_type_is_changed_refitted_and_accepted(page, folder):
    choose(page, "house-0")
    assert read_figure(page, "share_within_20cm") < 0.5
    page.select_option("#type", "gable")
    wait_for_building(page, "house-0: gable")
    press_key(page, "r")
    assert read_figure(page, "share_within_20cm") > 0.95
    page.fill("#note", "seen from the street")
    page.keyboard.press("Enter")
    press_key(page, "a")
    assert page.inner_text("#say") == "accepted"
    assert page.get_attribute("[data-id=house-0]", "class").split() == ["current", "accepted"]
    edits = dict(read_overrides(str(folder / EDITS_FILE)))
    assert edits["house-0"]["parts"][0]["type"] == "gable"
    assert edits["house-0"]["note"] == "seen from the street"


def test_keys_go_through_the_buildings_and_can_be_turned_off(page):
    first = page.inner_text("#title")
    for letter in "n", "p":
        press_key(page, letter)
    assert page.inner_text("#title") == first
    press_key(page, "a")
    press_key(page, "n")
    second = page.inner_text("#title")
    assert second != first
    press_key(page, "s")
    assert page.locator("[data-part]").count() == 2
    press_key(page, "u")
    assert page.locator("[data-part]").count() == 1
    press_key(page, "u")
    assert page.inner_text("#say") == "nothing to undo"
    for count in 1, 2:
        page.focus("#letter-keys")
        page.keyboard.press("Space")
        press_key(page, "s")
        assert page.locator("[data-part]").count() == count
    # U+202E turns what follows it, in programs that obey it
    shown = page.evaluate(
        """() => {
          rows[0].id = "house-\u202e0"; showList();
          return rows[0].button.firstChild.textContent;
        }"""
    )
    assert shown.startswith("house-\\u202e0 ")


def test_a_handle_drags_the_ridge_and_undo_brings_it_back(page):
    choose(page, "house-0")
    page.select_option("#type", "gable")
    wait_for_building(page, "house-0: gable")
    old_height = read_figure(page, "ridge_height")
    box = page.locator("[data-handle=ridge]").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 25, steps=4)
    page.mouse.move(x, y - 50, steps=4)
    page.mouse.up()
    wait_until_true(page, f"now.model.figures.ridge_height > {old_height + 0.5}")
    page.evaluate("() => queue")
    assert page.is_checked("[data-pin=height]")
    raised = read_figure(page, "ridge_height")
    press_key(page, "r")
    # what a hand set is kept
    assert read_figure(page, "ridge_height") == pytest.approx(raised, abs=0.005)
    press_key(page, "u")
    press_key(page, "u")
    assert read_figure(page, "ridge_height") == old_height and not page.is_checked(
        "[data-pin=height]"
    )


def test_an_edge_and_a_number_change_the_model(page):
    choose(page, "house-0")
    volume = read_figure(page, "volume_m3")
    page.fill("[data-name=ridge_height]", "11")
    page.keyboard.press("Enter")
    wait_until_true(page, "now.model.figures.ridge_height === 11")
    assert read_figure(page, "volume_m3") > volume
    page.fill("[data-name=rotation]", "")  # no number changes nothing
    page.keyboard.press("Tab")
    page.evaluate("() => queue")
    assert (
        read_figure(page, "ridge_height") == 11.0 and page.input_value("[data-name=rotation]") != ""
    )
    page.fill("[data-name=width]", "-3")
    page.keyboard.press("Enter")
    page.evaluate("() => queue")
    assert (
        "expected a positive width" in page.inner_text("#say")
        and read_figure(page, "ridge_height") == 11.0
    )


def test_a_click_on_the_roof_chooses_its_part(page):
    choose(page, "house-0")
    press_key(page, "s")
    # else both are one face
    page.fill("[data-name=ridge_height]", str(read_figure(page, "ridge_height") + 0.5))
    page.keyboard.press("Enter")
    page.evaluate("() => queue")
    page.evaluate(
        "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    middles = page.evaluate(
        "() => now.model.handles.map(h => viewer.project([...h.place, h.ridge])).map(([x, y]) => { "
        "const box = viewer.canvas.getBoundingClientRect(); return [box.left + x, box.top + y]; })"
    )
    # handles of the chosen part may lie over its middle, so each is chosen from the other
    for index in (1, 0):
        page.evaluate(f"() => choose({1 - index})")
        page.mouse.click(*middles[index])
        assert page.get_attribute(f"[data-part='{index}']", "class") == "part current"


def test_the_ground_and_leaving_out_are_accepted_and_obeyed_by_the_next_run(
    town_files, page, folder
):
    choose(page, "house-1")
    old_volume = read_figure(page, "volume_m3")
    page.fill("#ground", "1.25")
    page.keyboard.press("Enter")
    wait_until_true(page, "now.model.figures.z_ground === 1.25")
    page.evaluate("() => queue")
    assert read_figure(page, "volume_m3") > old_volume
    press_key(page, "u")
    assert read_figure(page, "volume_m3") == old_volume and page.input_value("#ground") != "1.25"
    page.fill("#ground", "1.25")
    page.keyboard.press("Enter")
    press_key(page, "a")
    assert page.inner_text("#say") == "accepted"
    choose(page, "house-2")
    press_key(page, "o")
    assert page.inner_text("#title") == "house-2: left out" and "no model" in page.inner_text(
        "#say"
    )
    press_key(page, "r")
    assert "left out; keep it in first" in page.inner_text("#say")
    press_key(page, "u")
    assert page.inner_text("#title") == "house-2: flat"
    page.click("#leave-out")
    press_key(page, "a")
    overrides = dict(read_overrides(str(folder / EDITS_FILE)))
    assert (
        overrides["house-1"]["z_ground"] == 1.25
        and overrides["house-2"]["leave_out"] is True
        and "parts" not in overrides["house-2"]
    )
    hiproof.reconstruct_area(make_request(town_files, folder, folder / EDITS_FILE))
    rows = by_id(folder)
    assert rows["house-1"]["z_ground"] == 1.25 and rows["house-2"]["status"] == "left_out"
    page.reload()
    wait_for_building(page, "house-")
    page.evaluate("() => inTurn(() => open('house-2'))")
    page.evaluate("() => queue")
    assert (
        page.inner_text("#title") == "house-2: left out"
        and page.inner_text("#leave-out") == "keep in"
    )
    page.click("#withdraw")
    page.evaluate("() => queue")
    assert set(dict(read_overrides(str(folder / EDITS_FILE)))) == {"house-1"}


def test_undo_back_to_what_was_accepted_leaves_nothing_changed_as_its_tag_says(page):
    choose(page, "house-0")
    mark = "[data-id=house-0]"
    page.select_option("#type", "gable")
    wait_for_building(page, "house-0: gable")
    assert "draft" in page.get_attribute(mark, "class").split()
    press_key(page, "u")
    assert page.get_attribute(mark, "class").split() == ["current"]
    press_key(page, "a")
    page.select_option("#type", "gable")
    wait_for_building(page, "house-0: gable")
    press_key(page, "u")
    assert page.get_attribute(mark, "class").split() == ["current", "accepted"]
    choose(page, "house-1")
    press_key(page, "s")
    for id, text in (("house-0", "accepted"), ("house-1", "changed")):
        row, tag = page.locator(f"[data-id={id}]"), page.locator(f"[data-id={id}] .tag")
        assert tag.inner_text() == text
        outer, inner = row.bounding_box(), tag.bounding_box()
        assert outer["y"] <= inner["y"]
        assert inner["y"] + inner["height"] <= outer["y"] + outer["height"]
        assert inner["x"] + inner["width"] <= outer["x"] + outer["width"]
    assert page.locator(".tag:visible").count() == 2


def test_a_server_that_is_gone_is_said_and_costs_nothing(page):
    """The page's own `fetch` answers otherwise, since to come between it and the network takes the
    browser a moment.
    """
    choose(page, "house-0")
    displayed = page.inner_text("#title"), read_figure(page, "share_within_20cm")
    page.evaluate("() => { window.reached = window.fetch; }")
    for answer, message in [
        ("Promise.reject(new TypeError('Failed to fetch'))", "the server does not answer"),
        ("Promise.resolve(new Response('<html>', { status: 502 }))", "the server answered 502"),
    ]:
        page.evaluate(f"() => {{ window.fetch = () => {answer}; }}")
        press_key(page, "r")
        assert message in page.inner_text("#say")
        assert (page.inner_text("#title"), read_figure(page, "share_within_20cm")) == displayed
    page.evaluate("() => { window.fetch = window.reached; }")
    press_key(page, "r")
    assert page.inner_text("#say") == ""


def test_two_windows_and_one_building(browser, page_service, page):
    other = open_window(browser, page_service)
    for window in (page, other):
        choose(window, "house-2")
    press_key(page, "a")
    other.select_option("#type", "hip")
    wait_for_building(other, "house-2: hip")
    press_key(other, "a")
    assert "anna accepted" in other.inner_text("#say")
    other.click("#mine")
    wait_until_true(other, "$('say').textContent === 'accepted'")
    assert page_service.desk.edits.of("house-2")[0]["parts"][0]["type"] == "hip"
    page.reload()
    wait_for_building(page, "house-")
    choose(page, "house-2")
    assert page.inner_text("#title") == "house-2: hip"
    page.click("#withdraw")
    wait_for_building(page, "house-2: flat")
    assert other.faults == []
    other.context.close()


@at_every_size
def test_axe_finds_nothing_and_the_whole_building_is_shown(browser, page_service, size):
    with pages.open_page(browser, page_service.address, size) as page:
        wait_for_building(page, "house-")
        places = project_on_canvas(page, "viewer", "viewer.corners")
        lower, upper = np.min(places, axis=0), np.max(places, axis=0)
        assert (lower >= 0).all() and (upper <= 1).all() and (upper - lower).max() > 0.4
        assert list_complaints(page) == [] and not is_too_wide(page)
        for letter in "a", "s":
            press_key(page, letter)
        page.evaluate("() => inTurn(tryTypes)")
        assert page.locator("[data-try]").count() > 5
        aside = "document.querySelector('aside')"
        assert page.evaluate(f"() => {aside}.scrollWidth <= {aside}.clientWidth")
        assert list_complaints(page) == [] and not is_too_wide(page)


def read_focus(page):
    return page.evaluate(
        "() => ({ id: document.activeElement.id, ...document.activeElement.dataset })"
    )


def read_width(page):
    return float(page.input_value("[data-name=width]"))


def test_a_building_is_edited_by_keys_alone(page):
    first, second, *_ = page.evaluate("() => rows.map(row => row.id)")
    assert pages.list_tab_stops(page, 2)[0] == "find"
    assert read_focus(page)["open"] == first
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    wait_for_building(page, second)
    assert read_focus(page)["open"] == second
    assert page.get_attribute(f"[data-open={second}]", "aria-current") == "true"
    press_key(page, "s")
    page.focus("[data-part='1']")
    page.keyboard.press("Enter")
    assert page.get_attribute("[data-part='1']", "class") == "part current"
    assert read_focus(page)["part"] == "1"
    page.focus("#type")
    page.keyboard.press("ArrowDown")
    wait_until_true(page, "now.model.parts[1].type !== now.model.parts[0].type")
    page.evaluate("() => queue")
    assert read_focus(page)["id"] == "type"
    page.focus("[data-name=width]")
    width = read_width(page)
    for _ in range(2):
        press_key(page, "ArrowUp")
    assert read_focus(page)["name"] == "width" and read_width(page) == width + 2
    press_key(page, "Tab")
    assert read_focus(page)["name"] == "length"
    page.focus("#ground")
    press_key(page, "ArrowUp")
    assert read_focus(page)["id"] == "ground"
    page.focus("#refit")
    page.keyboard.press("Enter")
    page.evaluate("() => queue")
    assert read_focus(page)["id"] == "refit"
