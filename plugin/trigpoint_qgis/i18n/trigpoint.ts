<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1">
 <context>
  <name>Trigpoint</name>
  <message>
   <source>A pick agrees up to this residual (m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>A virtual environment or a folder of Python packages. Empty: the one that the panel installs in your profile. It comes after QGIS's own packages, never before.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Accuracy: RMSE from the reconstruction to the reference (m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Align: fit one similarity to picks</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Apply: carry a cloud into the frame</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Audit: run a project and write its report</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Bundle</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Bundle as a zip</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>CRS of both, in place of what the files say</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>CRS of the frame, in place of the similarity's</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>CRS of the target</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Cancel</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Carried cloud</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Carries a LAS, LAZ, PLY, E57, PCD or XYZ cloud through the similarity that Align wrote. Every attribute is kept, normals are turned, faces are carried.

The end of the output's name says its format: .laz, .las, .ply, .xyz, .csv or .txt.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Carry it back, from the frame into its own units</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Cell of the maps (m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Choose folder…</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Cloud (LAS, LAZ, PLY, E57, PCD or XYZ)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Clouds are drawn with</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Compare: accuracy and completeness</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Completeness (%)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Completeness thresholds (m); the last one is mapped</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Completeness: RMSE from the reference to the reconstruction (m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Consensus (all: every control pick is fitted, none is rejected)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Copied. When they have run, close this panel and open it again.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Copy commands</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Cuts of the height zones (shares of the reference's height)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Draw picks, completeness and error as layers</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Error (RMSE, m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Fits one scale, rotation and translation to at least three pairs of points and says what they are worth: residuals, leave-one-out, reliability and geometry.

Picks: a CSV with the columns id, source_x, source_y, source_z, target_x, target_y, target_z, and optionally role (control, check or off), sigma_source and sigma_target.

Consensus: ransac draws sets of three picks, exhaustive tries every set; picks that do not agree with the best one are rejected. With all, none is. Check picks are never fitted.

CRS: of the target's coordinates, a projected one. Without it the layers have none.

A residual vector runs from where the fit puts a pick to where it was picked, drawn longer than it is; d_m in its table is its true length.

The similarity (JSON) is what Apply needs.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Folder of Python packages</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Folder of the bundle</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Folder of the layers</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Footprint</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Footprint of the reconstruction</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>For a terminal: the two commands that Install… would run.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Images (slower, works everywhere)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Installing: this takes a few minutes.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Install…</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Leave-one-out RMSE (m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Makes an environment in your profile, {folder}. Takes some minutes.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Margin around the reference that counts (m); empty: no crop</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Measures distances between a georeferenced reconstruction and a reference cloud both ways, over all and by height zone, after thinning both on one lattice.

Maps: completeness is the share of the reference's voxels in a cell that the reconstruction comes within the last threshold of; error is the RMSE of the reconstruction's voxels in a cell. Both count all heights above a cell.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>OpenGL</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>OpenGL where it works, else images</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Picks</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Picks on the map</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Picks that are fitted</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Picks that do not fit the others</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Points</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Project (project.toml)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Python environment</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>RMSE of the picks that are fitted (m)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Ready.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Reconstruction, in the frame of the reference</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Reference (LiDAR)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Refine the pose by rigid ICP first</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Removes what was made so far.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Report (HTML)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Residual vectors</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Residual vectors are drawn so many times longer</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Results</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Runs everything a project.toml names and writes a bundle: results, tables, clouds, and the report as HTML and PDF. It runs beside QGIS, in the Python environment that holds trigpoint's packages.

Verdict: PASS, CONDITIONAL or FAIL by the project's own limits, NOT TESTED without.

The panel writes a project.toml of what is open in it, and `trigpoint new` of a folder of clouds.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Scale</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Seed of the draws</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Sets of three picks drawn by ransac</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Share of the reference within the last threshold (%)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Similarity</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Similarity that Align wrote</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Some Python packages are missing</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>The panel can't be shown</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>The panel shows point clouds with VTK and reads them with packages that QGIS does not bring.

{named}

With what reports need they take {size}. They go into a folder of their own and come after QGIS's own packages, never before: no other plugin notices. QGIS need not be restarted.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Trigpoint help</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Trigpoint panel</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Uses an environment, or a folder of packages, that you have already.</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Verdict</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Voxel (m; 0: no thinning)</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Warnings</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Weight by the picks' sigmas</source>
   <translation type="unfinished"/>
  </message>
  <message>
   <source>Whether the picks pin the similarity down</source>
   <translation type="unfinished"/>
  </message>
 </context>
</TS>
