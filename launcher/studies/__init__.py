"""Studies: experiments that are run, drawn and summed up by one command each (``sightline study NAME``).

Every study is a function of a folder and a few numbers; its figures stand beside the CSV files they are drawn from.
"""
