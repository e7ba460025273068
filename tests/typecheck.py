"""beartype as jaxtyping's run-time checker; an int is taken where a float is annotated."""

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
