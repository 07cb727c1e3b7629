#!/usr/bin/env python3
"""Checks that a bag of record.launch holds what it should: check_bag.py BAG. Exit status 1 when it does not."""
import sys

import rosbag
import yaml

WANTED = ['scan', 'joint_states', 'odom', '/tf', '/tf_static', 'tunnel_state', 'command', 'arbiter_state', 'truck_status',
          'preview_driver/proposal', '/diagnostics', 'run_info']

with rosbag.Bag(sys.argv[1]) as bag:
    topics = bag.get_type_and_topic_info().topics
    missing = [topic for topic in WANTED if topic not in topics]
    compression = bag.get_compression_info().compression
    infos = [yaml.safe_load(message.data) for _, message, _ in bag.read_messages('run_info')]

assert not missing, f'not recorded: {missing}'
assert compression == 'lz4', compression
assert all(info == infos[0] for info in infos), 'run_info says several things'  # latched: a recorder may get it twice
parameters = infos[0]['parameters']
assert parameters['/arbiter']['envelope']['margin'] == 0.2, parameters['/arbiter']
assert parameters['/simulator']['real_time_factor'] == 3, parameters['/simulator']
assert infos[0]['version'] and infos[0]['time'] > 0.0
assert len(infos[0]['files'][parameters['/arbiter']['truck_file']]) == 64
print(f"{topics['scan'].message_count} scans, {len(parameters)} nodes with parameters")
