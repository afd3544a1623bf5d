"""Quality of models against points, footprints and others, and the report.

models             finished models read back from CityJSON
distance           exact distances from points to polygons; compiled
metrics            residuals, shares within a tolerance, IoU: the quality of one model
layers             points that leave a roof to doubt: two surfaces, one over the other, or none for
                   a part of it
verdict            good, fair or poor: the grade of a model by its points, and what speaks against
                   it
overview           how many buildings were modelled, how well, and which need attention
evaluation         a row of figures a building, and summaries
inputs             where the files that a run was made from lie now
run                a finished run with its points: what the commands start from
report             the page about a run: map, distributions, the worst twenty, 3D
report_data        what that page draws, packed
report_pictures    its small pictures
"""
