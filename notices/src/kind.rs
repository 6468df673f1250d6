//! Every kind of notice with its weight: the one table.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How much a notice weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Weight {
    /// The model may be wrong: something is missing, misplaced, or did not come to its end.
    Heavy,
    /// Something is rougher than it could be.
    Light,
}

macro_rules! kinds {
    ($($(#[$more:meta])* $name:ident $weight:ident $doc:literal,)*) => {
        /// Which finding a notice tells.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        pub enum Kind {
            $(#[doc = $doc] $(#[$more])* $name,)*
        }

        impl Kind {
            /// How much a notice of this kind weighs.
            pub fn weight(self) -> Weight {
                match self {
                    $(Kind::$name => Weight::$weight,)*
                }
            }
        }
    };
}

kinds! {
    // What readers of surfaces and pictures tell
    OneColour Light "Every vertex of a scan has one colour.",
    CoarseNumbers Light "Numbers in coarse steps: rounded, or of single precision far from the origin.",
    ColourScale Light "Colours read on another scale than usual.",
    ColoursUnused Light "Colours that only some vertices have.",
    NoTexture Light "A material without texture or colour.",
    TextureUnplaced Light "A texture without coordinates.",
    FaceColours Light "Colours on faces in place of vertices.",
    ShearedGrid Light "Axes of voxels that are not square.",
    NoHeaderPlace Light "A header that says not where its voxels lie.",
    EmptySlices Light "Slices without a frame.",
    FractionalLabels Light "A fractional segmentation.",
    StrangeFiles Heavy "Files of a series that are no slices.",
    OtherPictures Heavy "Pictures of another kind in a series.",
    DoubledSlices Heavy "Slices that are there twice.",
    TiltedGantry Light "A tilted gantry.",
    // What readers of tables tell
    SheetChosen Light "One of several sheets of a workbook is read.",
    HiddenRows Light "Rows that a workbook hides.",
    Encoding Light "A text in another encoding than UTF-8.",
    TitleLines Light "Lines above the header.",
    BlankRows Light "Rows without a cell.",
    IndexColumn Heavy "A column that counts the rows.",
    WordsForNothing Light "Words that stand for a missing value.",
    UnnamedColumns Heavy "Columns that the format does not name.",
    NoLoad Light "A load that was not measured.",
    LoadAgainstTest Heavy "A load that does not point as its test says.",
    NoFlexion Light "A flexion that was not measured.",
    FlexionFarFromNominal Light "A flexion far from the nominal one.",
    SignDoubt Light "A sign, zero or scale that looks wrong.",
    Averaged Light "Rows averaged to readings.",
    MoreLikeThese Light "Further notices that are not repeated.",
    // segment
    OtherGrid Light "Labels on another grid than the volume.",
    InPieces Light "A bone that came out in pieces.",
    BodiesLeftOut Heavy "Bodies of bone that are none of the knee's.",
    // ingest
    NoCompanion Light "A file that another one names and that is not there.",
    OddSize Heavy "A bone that is no adult's in size.",
    Spikes Heavy "Vertices far off all their neighbours.",
    DroppedTriangles Light "Triangles without area or doubled.",
    TurnedTriangles Light "Triangles turned over.",
    PiecesBeside Light "Loose pieces beside a bone.",
    Cavities Light "Cavities or inner shells.",
    IrregularEdges Light "Edges of more than two triangles.",
    OpenEdges Light "Open edges of a closed surface.",
    ClosedScan Light "A scan that was closed before.",
    MixedColours Light "A coloured scan merged with one without colours.",
    OverlappingSegments Light "Voxels in several segments.",
    UnnamedLabels Heavy "Labels that nothing names.",
    BridgeCut Light "Pieces that hung on by a voxel.",
    LoosePieces Heavy "Loose pieces of a label.",
    VoidsFilled Light "Holes within a label.",
    BothPlateaus Light "One label for the cartilage of both plateaus.",
    FibresOffBones Light "Given fibres off their bones in the median.",
    FibreEndsOffBone Light "Ends of given fibres off their bone.",
    PointsOffSurface Light "Landmarks or marks off their surface in the median.",
    PatellaInFemur Light "A patella inside the femur.",
    PatellaFar Light "A patella far from the femur.",
    FrameOriginFar Light "A given frame's origin off its bone.",
    BodyFar Light "A segmented body far from its bone.",
    SidesExchanged Heavy "A meniscus on the other side of the joint.",
    GrownTogether Light "A second body that hangs on the femur.",
    NoFemoralHead Light "No centre of the femoral head.",
    LandmarkName Heavy "A landmark by a name that nothing reads, near one that is read.",
    FibreCount Light "Another number of fibres than the literature's.",
    NoFibula Light "No fibular shaft to tell the side by.",
    NoColours Light "A scan without colours.",
    NoScans Light "No scans of a dissected knee.",
    PatellaScanLeftOut Heavy "A scan of a patella that CT does not show.",
    // register
    CtSize Heavy "A CT bone that is too small or too large all over.",
    LandmarkMisplaced Heavy "A landmark that scan and CT place apart.",
    PatellaUnfit Heavy "A scan of the patella that does not fit.",
    CapsuleTooLittle Light "A capsule scan that shows too little.",
    CapsuleApart Light "A capsule scan apart from a bone's.",
    // bones
    HoleFilled Light "A hole in a CT surface.",
    Specks Light "Specks of a surface.",
    // cartilage
    FilmsLeftOut Heavy "Films and specks of a Boolean difference.",
    Tunnels Light "Tunnels through a cartilage.",
    SmallerPieces Heavy "Smaller pieces of a cartilage.",
    SmallerPatches Heavy "Smaller patches above a bone.",
    CartilageVolume Light "A cartilage of another volume than was given.",
    TooThick Light "A layer thicker than cartilage.",
    OneCondyle Heavy "A femur with cartilage on one condyle alone.",
    PlateausParted Light "Cartilages that had run together.",
    // frames
    ShortShaft Light "A shaft too short for its axis.",
    ShaftCutShort Light "A shaft that the picture cuts short.",
    Proportions Heavy "A femur that is stretched along one axis.",
    CondylarAxis Light "A condylar axis far from the transepicondylar one.",
    CtPoseTurned Heavy "A CT pose turned further than a knee at rest.",
    EpicondyleFar Light "An epicondyle's landmark far from what the bone shows.",
    OneEpicondyle Light "One epicondyle of two.",
    ShaftLandmarkFar Light "A landmark off the shaft's axis.",
    NoEminences Light "No intercondylar eminences.",
    GivenAxisFar Light "A given axis far from what the bone shows.",
    GivenOriginFar Light "A given origin far from what the bone shows.",
    // attachments
    MarkOffBone Light "A mark off the bone.",
    MarksExchanged Heavy "Marks of two ligaments in each other's place.",
    NoOutline Light "A mark without an outline.",
    BrokenOutline Light "An outline with gaps.",
    UnexpectedOutline Heavy "An outline that is of no expected site.",
    BundleLeftOut Heavy "A bundle without a site or fibre.",
    FibreLength Light "Fibres longer or shorter than usual.",
    ThroughBone Light "A bundle through bone.",
    GivenShifted Light "Given sites that are shifted together.",
    GivenFar Light "Given sites far from the literature's.",
    Unmarked Light "Sites from the literature on a scan with colours.",
    // hexmesh and overclosure
    FaceParts Light "A face of a cartilage in parts.",
    ThinSpots Light "Thin spots meshed over.",
    RaisedColumns Light "Columns raised to the least thickness.",
    InvertedElements Heavy "Inverted elements.",
    SmallGap Light "A gap smaller than wanted.",
    CartilagesApart Heavy "Cartilages that do not meet in the CT pose.",
    LiftedOff Light "Cartilage lifted off its bone.",
    // contact-law
    LawMisses Light "A fitted law that misses the model.",
    NotAtRest Light "A level of load not quite at rest.",
    ForceNotReached Light "A force that was not reached.",
    // assemble
    PatellaGap Light "An odd gap between patella and trochlea.",
    TendonLength Heavy "An odd length of the patellar tendon.",
    HornFar Light "A meniscal horn far from the literature's root.",
    MeniscusVolume Light "A meniscus of another volume than was given.",
    // calibrate
    RowLeftOut Heavy "A row without a coordinate that counts.",
    RowInPart Light "A row that lacks a coordinate.",
    TrackedElsewhere Heavy "Landmarks or frames of tracked bodies that are not the build's.",
    SetLacks Light "Tests that a set of targets lacks.",
    RepeatsDiffer Light "Repeats of one load that differ.",
    AgainstTheLoad Heavy "A knee that moves against its load.",
    FewSamples Light "Few samples near a fit.",
    PathEndsElsewhere Light "Measured loads whose path ends in another equilibrium than the search's.",
    JointWasBetter Light "A fit that the joint calibration improved.",
    NoiseStated Light "Another noise than the file states.",
    OutsidePrior Light "A value outside its interval before the data.",
    PriorUnused Light "A shared prior of numbers that the knee has not.",
    NoDerivatives Light "No derivatives at the best point.",
    CalibratedAlready Light "A model that is calibrated already.",
    // simulate, validate, diagnose
    NoPivotShift Light "No pivot shift without ACL.",
    LeavesPlateau Light "Rows in which the femur leaves the plateau.",
    RowFlagged Light "A row of results that is odd.",
    BeyondCalibration Light "Trials that ask for what the knee was not calibrated to.",
    ExplicitStopped Light "Explicit dynamics that were stopped early.",
    SolversApart Light "Rows in which the two solvers differ.",
    NothingCut Light "A graft beside a ligament that is not cut.",
    OtherPlan Light "Files of another plan beside those of this one.",
    ModelChanged Light "A model changed since its calibration.",
    NoIntervals Light "Values without intervals.",
    CrossLeftOut Light "Ranges of one data set that the knee of another does not predict.",
    SamplesLost Light "Samples without an equilibrium.",
    DisplacementsLeftOut Heavy "Displacements that a diagnosis cannot use.",
    ComponentsLeftOut Heavy "Added effects that are left out.",
    // decks and exports
    KeywordPassedOver Light "A keyword that is not read.",
    DeckOdd Light "Odd lines of a deck.",
    SpringsUnread Light "Springs that lead not from bone to bone.",
    ElementsUnread Light "Elements on neither bone.",
    UnknownBundle Light "A bundle that Table 3 has not.",
    FibreDamping Light "Another damping of fibres.",
    OddStiffness Light "A stiffness that no ligament has.",
    ForceTable Light "A force table that departs from the law.",
    Tetrahedra Light "Tetrahedra where hexahedra are usual.",
    DeckChanged Light "A deck changed as was asked.",
    SolidMissing Heavy "A solid mesh that is not there.",
    NotInFormat Light "What a format cannot express.",
    // all
    #[serde(other)]
    Other Light "A kind that this version does not know.",
}
