"""One field, one optimiser, seven losses: how near a mesh comes, how evenly its triangles lie, and in how long.

Run as ``python experiments/deforming/run.py``, on one thread. Finished fits are kept in ``partial.jsonl``, their meshes
in ``partial_meshes/``, so that a run that was stopped goes on where it ended. ``--early`` writes the results of what is
finished so far.

An *arm* is ``loss`` ("sliced", "chamfer", "sinkhorn"), ``encoding`` ("varifold", "samples", "surface": the exact
continuous measure, for "sliced" only) and ``supports`` ("full": as many as faces, the whole varifold; or a number: so
many faces or points drawn anew at every step, on both sides). A *setting* is ``target`` ("folded": analytic, another
member of the family for each seed; "fsaverage5_left", "fsaverage5_right"), ``start`` ("sphere", "smoothed"), ``seed``.

``results.json`` holds, under "results" (all lengths in mm, ``seconds`` CPU seconds of one thread, checks not counted):

- ``arms``: each arm with its ``learning_rate``, the best on the tuning seed by ASSD, and ``tried`` [{learning_rate,
  assd}];
- ``settings``: target, start, seed, ``n_vertices``, ``n_faces``, ``floor`` {metric: what the target scores against
  itself}, ``begin`` {metric: what the start scores};
- ``fits``: arm and setting; ``learning_rate``, ``n_iterations``, ``seconds``, ``lipschitz_per_step`` (bound of h·Lip),
  ``end`` {metric: value after the last step}, ``curve`` {``iteration``, ``seconds`` and METRICS: lists over the start
  and the twelve checks};
- ``summary``: target, start, arm, ``n_seeds``, ``at`` ("steps": after the last step of every arm; "seconds": when the
  first arm of the same setting and supports was done, linear between checks), and for each metric of the curves, and
  for ``seconds`` and ``iteration``, ``NAME_mean``, ``NAME_sd`` (null for one seed); at "steps" also for all of ``end``;
- ``differences``: target, start, encoding, supports, ``at`` ("steps", "seconds", "closeness": where both are as near
  by ASSD as the one that ends farther away), paired over seeds: Chamfer minus sliced, ``NAME_chamfer``,
  ``NAME_sliced``, ``NAME_gap``, ``NAME_low``, ``NAME_high`` (95 %, Student's t), ``n_seeds``;
- ``missing``: the settings and arms that were planned but are not here.

The metrics of ``end``, ``floor`` and ``begin``: those of :func:`meshot.metrics.evaluate.evaluate` (emd, swd, assd,
hausdorff, normals, signed_normals, intersecting_faces, intersecting_share, euler_number, area, volume, edge_variation,
area_variation, smallest_angle). METRICS of the curves: assd, normals, intersecting_faces, edge_variation,
area_variation, smallest_angle.

``meshes.safetensors.gz`` (read by ``meshes.read_meshes``, which gives :class:`meshot.Mesh`) holds for seed 0 of every
setting the start, the target and the end of every fit, named ``TARGET/START/begin``, ``TARGET/target``,
``TARGET/START/LOSS_ENCODING_SUPPORTS``; for the sliced and the Chamfer loss on varifolds, from the sphere to "folded",
also where the flow has them after each of its steps, named ``…/path``.
"""
