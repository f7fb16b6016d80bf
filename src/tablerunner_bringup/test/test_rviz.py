"""The RViz configuration asks for topics that exist, with a quality that they have."""

from __future__ import annotations

from pathlib import Path

import yaml

from tablerunner_ros.qos import topic_qos

FILE = Path(__file__).parents[1] / 'rviz' / 'tablerunner.rviz'


def test_rviz_topics_are_those_of_the_contract():
    """A display of a topic that nobody publishes, or that asks for too much, stays empty."""
    manager = yaml.safe_load(FILE.read_text(encoding='utf-8'))['Visualization Manager']
    asked = [item['Topic'] for item in manager['Displays'] if 'Topic' in item]
    assert len(asked) >= 5
    for topic in asked:
        offered = topic_qos(topic['Value'])
        assert offered.reliable or topic['Reliability Policy'] == 'Best Effort', topic
        assert offered.latched or topic['Durability Policy'] == 'Volatile', topic
    for tool in manager['Tools']:
        if 'Topic' in tool:
            topic_qos(tool['Topic']['Value'])
