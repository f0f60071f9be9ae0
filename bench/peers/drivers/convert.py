"""IN.laz OUT.laz|las: conversion in memory."""

import json
import sys

import laspy

scan = laspy.read(sys.argv[1], laz_backend=laspy.LazBackend.LazrsParallel)
scan.write(sys.argv[2], laz_backend=laspy.LazBackend.LazrsParallel)
print(json.dumps({"kept": len(scan.points)}))
