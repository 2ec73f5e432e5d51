"""rosbag2 folders: the metadata, and the sqlite3 storage."""
