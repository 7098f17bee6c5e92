"""A contact sheet: plates by their lights, cameras and frames in one picture, for approvals."""
