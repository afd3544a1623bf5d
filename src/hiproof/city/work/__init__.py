"""The tasks of a run, and where they are run.

tasks         the tasks by name, for processes that have imported nothing yet
sort          each point file, read once in chunks, leaves the points each work tile needs
noted         where the points of each file lie, for whoever wants some of them again
solve         each work tile reconstructs its own buildings and writes them as text, ready to join
solved        buildings counted as they are solved, for the progress of a run
ground        the ground around a building, from its tile's cells; a terrain model against it
seams         the heights of point files where they meet
surveys       the points of several surveys, and those of which a model is made
found         the roof of one building among points without classes
other_classes what the points of other classes say of a building
bundle_folders  the folders of bundles: their names, and which of them stay
bundles       the input of buildings that hiproof failed on, kept to be sent and run again
repro         such a building solved again
queue         the open tasks, worked off by an executor
executors     where tasks run: this process, processes, a Dask cluster
processes     the second of these, and how its workers begin and end
cores         how many processes pay on this machine
warm          what tasks call, compiled before they start
"""
