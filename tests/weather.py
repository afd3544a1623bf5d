"""Weather of a typical year as an EPW file."""

import numpy as np


def write_epw(path, latitude=52.0, longitude=4.36, zone=1):
    """Write weather of a year: a clear sky, every third day dull."""
    import pandas
    import pvlib

    times = pandas.date_range("2023-01-01 00:30", periods=8760, freq="h", tz=f"Etc/GMT-{zone}")
    sky = pvlib.location.Location(latitude, longitude).get_clearsky(times)
    dull = times.day_of_year.to_numpy() % 3 == 0
    ghi = np.where(dull, 0.3 * sky["ghi"], sky["ghi"]).round(1)
    dhi = np.where(dull, 0.3 * sky["ghi"], sky["dhi"]).round(1)
    dni = np.where(dull, 0.0, sky["dni"]).round(1)
    head = [f"LOCATION,Delft,-,NLD,TEST,0,{latitude},{longitude},{zone},0.0"]
    head += ["DESIGN CONDITIONS,0", "TYPICAL/EXTREME PERIODS,0", "GROUND TEMPERATURES,0"]
    head += ["HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0", "COMMENTS 1,a test", "COMMENTS 2,a test"]
    lines = [*head, "DATA PERIODS,1,1,Data,Sunday, 1/ 1,12/31"]
    for k, time in enumerate(times):
        stamp = f"2023,{time.month},{time.day},{time.hour + 1},60,?9"
        lines.append(",".join([stamp, *["10"] * 7, f"{ghi[k]},{dni[k]},{dhi[k]}", *["0"] * 19]))
    path.write_text("\n".join(lines) + "\n")
    return times, {"ghi": ghi, "dhi": dhi, "dni": dni}
