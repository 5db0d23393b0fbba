"""Studies performed: sessions on devices and on pages, whole studies, and what scripts do.

Here are the sessions with their devices, stages and folders (`sessions`), participants on a page in
a browser with the server they meet (`page`), films drawn as files, the quick path that simulates
without the engine, checks of a study before anybody is invited, the files of a new study, and the
functions that scripts import. Not here: the engine that performs a plan frame by frame
(`visavis.protocol`), and the words and options of commands (`visavis.cli`).
"""
