"""YAML files of settings, read so that a setting is what its text says."""

import json
import re
from pathlib import Path
from typing import Any

import yaml

from sim_node.errors import InvalidInput
from snca_ros.files import reason_of


class _Loader(yaml.SafeLoader):
    """A loader for which a key is given once, and only decimal numbers are numbers.

    YAML 1.1 reads 0111 as 73, 1:30 as 90, 1_0 as 10, 0x10 as 16, 1111-11-11 as a date and 1e3 as a
    text. Here 1e3 is a number and all others are texts, which the check of a number refuses as
    they were written.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        """Return the keys and values of a node; InvalidInput if a key is there twice."""
        lines: dict[tuple[str, str], int] = {}
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):  # others are no keys of dicts
                line = key.start_mark.line + 1
                if (first := lines.get((key.tag, key.value))) is not None:
                    raise InvalidInput(key.value, f'it in lines {first} and {line}', 'it once')
                lines[key.tag, key.value] = line
        return super().construct_mapping(node, deep)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers
            if tag.rpartition(':')[2] not in ('int', 'float', 'timestamp')]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_WHOLE = r'[-+]?(?:0|[1-9][0-9]*)'
_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:int', re.compile(rf'{_WHOLE}\Z'), [*'-+0123456789'],
)
_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(
        rf'(?:(?:{_WHOLE}(?:\.[0-9]*)?|[-+]?\.[0-9]+)(?:[eE][-+]?[0-9]+)?'
        r'|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))\Z'
    ),
    [*'-+.0123456789'],
)


def yaml_text(values: dict) -> str:
    """Return the text of a YAML file; numbers and texts may be of numpy's types."""
    return yaml.safe_dump(json.loads(json.dumps(values)), sort_keys=False)


def read_yaml(path: Path, expected: str) -> Any:
    """Return the content of the YAML file at `path`.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Raises:
        InvalidInput: it cannot be read, or a key is there twice.
    """
    try:
        return parse_yaml(path.read_text(encoding='utf-8'))
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise InvalidInput('file', reason_of(error), expected, str(path)) from None


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text; InvalidInput or YAMLError if it is invalid."""
    return yaml.load(text, Loader=_Loader)
