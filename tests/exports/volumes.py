"""Writes a picture in the formats that scanners and their programs use, by libraries that are not ours: `volumes.py VOLUME.nii.gz FOLDER`. Each file or
series is read again by the library that wrote it, or by another, and compared. A kind whose library is not installed is left out with a word; status 77
where none is."""

import pathlib
import sys

try:
    import nibabel
    import numpy
except ImportError:
    print("nibabel is not installed")
    sys.exit(77)

FLIP = numpy.diag([-1.0, -1.0, 1.0, 1.0])  # NIfTI is RAS, everything else here LPS


def left_out(kind, name):
    print(f"{kind}: left out, {name} is not installed")


def nifti(values, affine, out):
    for name, kind in (("nifti1", nibabel.Nifti1Image), ("nifti2", nibabel.Nifti2Image)):
        image = kind(values, affine)
        image.header.set_xyzt_units("mm")
        nibabel.save(image, out / f"{name}.nii.gz")
        assert numpy.array_equal(nibabel.load(out / f"{name}.nii.gz").get_fdata(), values)
        print(name)


def nrrd(values, affine, out):
    try:
        import nrrd as library
    except ImportError:
        return left_out("nrrd", "pynrrd")
    lps = FLIP @ affine
    header = {"space": "left-posterior-superior", "space directions": lps[:3, :3].T, "space origin": lps[:3, 3], "kinds": ["domain"] * 3}
    for name, encoding in (("nrrd", "gzip"), ("nrrd_raw", "raw")):
        library.write(str(out / f"{name}.nrrd"), values, {**header, "encoding": encoding})
        assert numpy.array_equal(library.read(str(out / f"{name}.nrrd"))[0], values)
        print(name)


def metaimage(values, affine, out):
    try:
        import SimpleITK as sitk
    except ImportError:
        return left_out("metaimage", "SimpleITK")
    lps = FLIP @ affine
    spacing = numpy.linalg.norm(lps[:3, :3], axis=0)
    image = sitk.GetImageFromArray(values.transpose(2, 1, 0))
    image.SetSpacing(spacing.tolist())
    image.SetDirection((lps[:3, :3] / spacing).flatten().tolist())
    image.SetOrigin(lps[:3, 3].tolist())
    for name, ending, packed in (("metaimage", "mha", True), ("metaimage_raw", "mhd", False)):
        sitk.WriteImage(image, str(out / f"{name}.{ending}"), packed)
        assert numpy.array_equal(sitk.GetArrayFromImage(sitk.ReadImage(str(out / f"{name}.{ending}"))).transpose(2, 1, 0), values)
        print(name)


def basics(values, affine, uid):
    """What a slice and a multi-frame file have in common."""
    from pydicom.dataset import Dataset, FileMetaDataset
    from pydicom.uid import ExplicitVRLittleEndian, generate_uid

    ds = Dataset()
    ds.file_meta = FileMetaDataset()
    ds.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    ds.file_meta.MediaStorageSOPClassUID = ds.SOPClassUID = uid
    ds.PatientName, ds.PatientID, ds.Modality = "Phantom", "0", "CT"
    ds.StudyInstanceUID, ds.SeriesInstanceUID, ds.FrameOfReferenceUID = (generate_uid(entropy_srcs=[uid, k]) for k in "abc")
    ds.Rows, ds.Columns = values.shape[1], values.shape[0]
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 16, 15, 1
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    return ds


def number(x):
    return f"{x:.10g}"[:16]


def slices(values, affine):
    """A data set a slice."""
    from pydicom.uid import CTImageStorage, generate_uid

    lps = FLIP @ affine
    spacing = numpy.linalg.norm(lps[:3, :3], axis=0)
    axes = lps[:3, :3] / spacing
    for k in range(values.shape[2]):
        ds = basics(values, affine, CTImageStorage)
        ds.SOPInstanceUID = ds.file_meta.MediaStorageSOPInstanceUID = generate_uid(entropy_srcs=["slice", str(k)])
        ds.InstanceNumber = k + 1
        ds.ImagePositionPatient = [number(x) for x in lps[:3] @ [0, 0, k, 1]]
        ds.ImageOrientationPatient = [number(x) for x in (*axes[:, 0], *axes[:, 1])]
        ds.PixelSpacing = [number(spacing[1]), number(spacing[0])]
        ds.SliceThickness = number(spacing[2])
        ds.RescaleSlope, ds.RescaleIntercept = 1, 0
        ds.PixelData = values[:, :, k].T.tobytes()
        yield ds


def series(values, affine, out):
    """Plain, and packed by pydicom's codecs."""
    try:
        import pydicom
        from pydicom.uid import JPEG2000, JPEG2000Lossless, RLELossless
    except ImportError:
        return left_out("dicom", "pydicom")
    kinds = {"dicom": None, "dicom_rle": RLELossless, "dicom_j2k": JPEG2000Lossless, "dicom_j2k_lossy": JPEG2000}
    for name, syntax in kinds.items():
        folder = out / name
        folder.mkdir()
        try:
            for k, ds in enumerate(slices(values, affine)):
                if syntax is not None:
                    more = {"j2k_cr": [8]} if syntax == JPEG2000 else {}
                    ds.compress(syntax, generate_instance_uid=False, **more)
                ds.save_as(folder / f"{k:04}.dcm", enforce_file_format=True)
                if syntax != JPEG2000:
                    assert numpy.array_equal(pydicom.dcmread(folder / f"{k:04}.dcm").pixel_array, values[:, :, k].T)
        except (RuntimeError, NotImplementedError, ValueError) as error:
            for file in folder.iterdir():
                file.unlink()
            folder.rmdir()
            left_out(name, f"pylibjpeg with its codecs ({str(error).splitlines()[0]})")
            continue
        print(name)


def jpeg_lossless(values, affine, out):
    """SimpleITK packs by GDCM: JPEG lossless, process 14, first-order prediction."""
    try:
        import pydicom
        import SimpleITK as sitk
    except ImportError:
        return left_out("dicom_jpeg", "SimpleITK or pydicom")
    folder = out / "dicom_jpeg"
    folder.mkdir()
    for file in sorted((out / "dicom").iterdir()):
        image = sitk.ReadImage(str(file))
        writer = sitk.ImageFileWriter()
        writer.SetFileName(str(folder / file.name))
        writer.KeepOriginalImageUIDOn()
        writer.SetUseCompression(True)
        writer.SetCompressor("JPEG")
        writer.Execute(image)
        packed = pydicom.dcmread(folder / file.name)
        assert packed.file_meta.TransferSyntaxUID == "1.2.840.10008.1.2.4.70", packed.file_meta.TransferSyntaxUID.name
    print("dicom_jpeg")


def enhanced(values, affine, out):
    """One file of many frames, as newer scanners write it."""
    try:
        from pydicom.dataset import Dataset
        from pydicom.sequence import Sequence
        from pydicom.uid import EnhancedCTImageStorage, JPEG2000Lossless, generate_uid
    except ImportError:
        return left_out("enhanced", "pydicom")

    def item(**fields):
        ds = Dataset()
        for key, value in fields.items():
            setattr(ds, key, value)
        return Sequence([ds])

    lps = FLIP @ affine
    spacing = numpy.linalg.norm(lps[:3, :3], axis=0)
    axes = lps[:3, :3] / spacing
    for name, syntax in (("enhanced", None), ("enhanced_j2k", JPEG2000Lossless)):
        ds = basics(values, affine, EnhancedCTImageStorage)
        ds.SOPInstanceUID = ds.file_meta.MediaStorageSOPInstanceUID = generate_uid(entropy_srcs=[name])
        ds.NumberOfFrames = values.shape[2]
        shared = Dataset()
        shared.PixelMeasuresSequence = item(PixelSpacing=[number(spacing[1]), number(spacing[0])], SliceThickness=number(spacing[2]))
        shared.PlaneOrientationSequence = item(ImageOrientationPatient=[number(x) for x in (*axes[:, 0], *axes[:, 1])])
        shared.PixelValueTransformationSequence = item(RescaleIntercept=0, RescaleSlope=1, RescaleType="HU")
        ds.SharedFunctionalGroupsSequence = Sequence([shared])
        frames = []
        for k in range(values.shape[2]):
            frame = Dataset()
            frame.PlanePositionSequence = item(ImagePositionPatient=[number(x) for x in lps[:3] @ [0, 0, k, 1]])
            frame.FrameContentSequence = item(InStackPositionNumber=k + 1, StackID="1")
            frames.append(frame)
        ds.PerFrameFunctionalGroupsSequence = Sequence(frames)
        ds.PixelData = values.transpose(2, 1, 0).tobytes()
        try:
            if syntax is not None:
                ds.compress(syntax, generate_instance_uid=False)
        except (RuntimeError, NotImplementedError, ValueError) as error:
            left_out(name, f"pylibjpeg with its codecs ({str(error).splitlines()[0]})")
            continue
        (out / name).mkdir()
        ds.save_as(out / name / "knee.dcm", enforce_file_format=True)
        print(name)


def segmentation(values, affine, out, structures):
    """highdicom's DICOM SEG, binary and fractional, of segments named as in specimen.toml; frames without a voxel are left out."""
    try:
        import highdicom
        from pydicom.sr.codedict import codes
        from pydicom.uid import ExplicitVRLittleEndian, RLELossless
    except ImportError:
        return left_out("seg", "highdicom")
    source = []
    for ds in slices(values, affine):
        ds.StudyDate = ds.StudyTime = ds.AccessionNumber = ds.StudyID = ds.PatientBirthDate = ds.PatientSex = ds.ReferringPhysicianName = ""
        source.append(ds)
    planes = values.transpose(2, 1, 0)
    stack = numpy.stack([planes == label for label in structures.values()], axis=-1)
    described = [
        highdicom.seg.SegmentDescription(
            segment_number=k + 1,
            segment_label=name,
            segmented_property_category=codes.SCT.Tissue,
            segmented_property_type=codes.SCT.Bone,
            algorithm_type=highdicom.seg.SegmentAlgorithmTypeValues.MANUAL,
        )
        for k, name in enumerate(structures)
    ]
    kinds = highdicom.seg.SegmentationTypeValues
    for name, kind, syntax in (
        ("seg", kinds.BINARY, ExplicitVRLittleEndian),
        ("seg_fractional", kinds.FRACTIONAL, ExplicitVRLittleEndian),
        ("seg_fractional_rle", kinds.FRACTIONAL, RLELossless),
        ("seg_labelmap", kinds.LABELMAP, ExplicitVRLittleEndian),
    ):
        try:
            made = highdicom.seg.Segmentation(
                source_images=source,
                pixel_array=stack.astype(numpy.float32) if kind == kinds.FRACTIONAL else stack.astype(numpy.uint8),
                segmentation_type=kind,
                segment_descriptions=described,
                series_instance_uid=highdicom.UID(),
                series_number=2,
                sop_instance_uid=highdicom.UID(),
                instance_number=1,
                manufacturer="Phantom",
                manufacturer_model_name="Phantom",
                software_versions="1",
                device_serial_number="1",
                transfer_syntax_uid=syntax,
                omit_empty_frames=True,
            )
        except (AttributeError, RuntimeError, NotImplementedError, ValueError) as error:
            left_out(name, f"a highdicom that writes it ({str(error).splitlines()[0]})")
            continue
        made.save_as(out / f"{name}.dcm")
        print(name)


def main():
    source, out = map(pathlib.Path, sys.argv[1:3])
    image = nibabel.load(source)
    values = numpy.ascontiguousarray(numpy.round(image.get_fdata()).astype(numpy.int16))
    structures = dict(word.split("=") for word in sys.argv[3:] if "=" in word)
    if structures:
        return segmentation(values, image.affine, out, {key: int(label) for key, label in structures.items()})
    nifti(values, image.affine, out)
    nrrd(values, image.affine, out)
    metaimage(values, image.affine, out)
    if "--labels" not in sys.argv:
        series(values, image.affine, out)
        if (out / "dicom").is_dir():
            jpeg_lossless(values, image.affine, out)
        enhanced(values, image.affine, out)


if __name__ == "__main__":
    main()
