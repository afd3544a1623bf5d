"""Weather of a typical year as EPW, TMY3 and PVGIS files."""

import datetime
import functools
import json

import numpy as np

NAMES = ("ghi", "dhi", "dni")


@functools.cache
def simulate_weather(latitude=52.0, longitude=4.36, zone=1):
    """Return the middles of a year's hours and their irradiance: every third day is dull."""
    import pandas
    import pvlib

    times = pandas.date_range(
        "2023-01-01 00:30",
        periods=8760,
        freq="h",
        tz=datetime.timezone(datetime.timedelta(hours=zone)),
    )
    sky = pvlib.location.Location(latitude, longitude).get_clearsky(times)
    dull = times.day_of_year.to_numpy() % 3 == 0
    ghi = np.where(dull, 0.3 * sky["ghi"], sky["ghi"]).round(1)
    dhi = np.where(dull, 0.3 * sky["ghi"], sky["dhi"]).round(1)
    dni = np.where(dull, 0.0, sky["dni"]).round(1)
    return times, {"ghi": ghi, "dhi": dhi, "dni": dni}


def write_epw(
    path, latitude=52.0, longitude=4.36, zone=1, said_zone=None, change=lambda columns: None
):
    """Write weather of a year as EPW. Its head may name another zone, and `change` may spoil its
    columns: irradiance, and stamps.
    """
    times, values = simulate_weather(latitude, longitude, zone)
    stamps = [f"2023,{time.month},{time.day},{time.hour + 1},60,?9" for time in times]
    columns = {name: np.array(column, float) for name, column in values.items()}
    change(columns := {**columns, "stamps": stamps})
    ghi, dhi, dni = (columns[name] for name in NAMES)
    said_zone = zone if said_zone is None else said_zone
    head = [f"LOCATION,Delft,-,NLD,TEST,0,{latitude},{longitude},{said_zone},0.0"]
    head += ["DESIGN CONDITIONS,0", "TYPICAL/EXTREME PERIODS,0", "GROUND TEMPERATURES,0"]
    head += ["HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0", "COMMENTS 1,a test", "COMMENTS 2,a test"]
    lines = [*head, "DATA PERIODS,1,1,Data,Sunday, 1/ 1,12/31"]
    for k, stamp in enumerate(columns["stamps"]):
        lines.append(",".join([stamp, *["10"] * 7, f"{ghi[k]},{dni[k]},{dhi[k]}", *["0"] * 19]))
    path.write_text("\n".join(lines) + "\n")
    return times, values


def write_tmy3(path, latitude=52.0, longitude=4.36, zone=1):
    """Write weather of a year as TMY3: stamps end the hours."""
    times, values = simulate_weather(latitude, longitude, zone)
    lines = [f"1,Delft,NL,{zone},{latitude},{longitude},0"]
    names = ("GHI (W/m^2)", "DHI (W/m^2)", "DNI (W/m^2)")
    lines += [",".join(["Date (MM/DD/YYYY)", "Time (HH:MM)", *names])]
    for k, time in enumerate(times):
        stamp = f"{time.month:02}/{time.day:02}/1990,{time.hour + 1:02}:00"
        lines.append(",".join([stamp, *(str(values[name][k]) for name in NAMES)]))
    path.write_text("\n".join(lines) + "\n")


def write_pvgis(path, latitude=52.0, longitude=4.36):
    """Write weather of a year as PVGIS' table, or as its JSON: half an hour after the stamps."""
    times, values = simulate_weather(latitude, longitude, 0)
    years = [2005 + month for month in range(12)]
    stamps = [f"{years[t.month - 1]}{t:%m%d}:{t.hour:02}00" for t in times]
    names = ("G(h)", "Gd(h)", "Gb(n)")
    if path.suffix == ".json":
        place = {"latitude": latitude, "longitude": longitude, "irradiance_time_offset": 0.5}
        rows = [
            {"time(UTC)": stamp} | {n: values[o][k] for n, o in zip(names, NAMES, strict=True)}
            for k, stamp in enumerate(stamps)
        ]
        months = [{"month": m, "year": years[m - 1]} for m in range(1, 13)]
        outputs = {"months_selected": months, "tmy_hourly": rows}
        record = {"inputs": {"location": place}, "outputs": outputs, "meta": {"inputs": {}}}
        path.write_text(json.dumps(record))
        return
    lines = [f"Latitude (decimal degrees): {latitude}", f"Longitude (decimal degrees): {longitude}"]
    lines += ["Elevation (m): 0.0", "Irradiance Time Offset (h): 0.5", "month,year"]
    lines += [f"{month},{years[month - 1]}" for month in range(1, 13)]
    lines += [",".join(["time(UTC)", *names])]
    lines += [
        ",".join([stamp, *(str(values[name][k]) for name in NAMES)])
        for k, stamp in enumerate(stamps)
    ]
    path.write_text("\n".join(lines) + "\nG(h): Global irradiance\n")
