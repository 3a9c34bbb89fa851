"""Arrays of commands, properties and frames: conversion, columns by name, protection from lost writes."""
