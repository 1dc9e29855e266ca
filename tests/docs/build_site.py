"""Build the site as `docs/conf.py` says: any warning is an error.

python build_site.py DOCS FOLDER
"""

import gc
import sys

from sphinx.cmd.build import main

gc.disable()  # nothing of a build is garbage before its end: a fifth of its time was spent on the search
sys.exit(main(["-W", "--keep-going", "-n", "-q", "-b", "html", *sys.argv[1:]]))
